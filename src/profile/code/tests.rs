//! Operations of kernels whose loops are known.
use super::*;
use crate::gpu::Bindings;
use crate::layout::Effects;
use crate::shaders::{self, ceiling_arithmetic, shared};

fn code<B: Bindings>(constants: &[(u32, u32)]) -> Code {
    Code::new(B::SPIRV, constants).unwrap()
}

#[test]
fn a_loop_counts_as_often_as_it_turns() {
    let operations = code::<ceiling_arithmetic::Bind>(&[]).per_thread(&[]);
    let (turns, each) = (u64::from(ceiling_arithmetic::TURNS), u64::from(ceiling_arithmetic::OPERATIONS));
    assert!(!operations.is_least);
    // The counter adds and compares in every turn; outside of the loop there are a few dozen.
    let own = operations.count - turns * each;
    assert!((2 * turns..=4 * turns + 64).contains(&own), "{operations:?}");
}

#[test]
fn taps_of_filters_are_all_counted() {
    // Five columns of taps; eight taps of a column for each of four pixels, five of which count for each.
    let atrous = code::<shaders::atrous::Bind>(&[]).per_thread(&[]);
    assert!(!atrous.is_least && atrous.count > 5 * 4 * 5 * 10, "{atrous:?}");
    // Twice seven columns of taps.
    let noise = code::<shaders::noise_estimate::Bind>(&[]);
    let found: Vec<_> = noise.loops.iter().map(|each| (each.turns, each.parent)).collect();
    assert_eq!(found, [(Some(7), None), (Some(7), None)]);
}

#[test]
fn constants_decide_branches_and_bounds() {
    let count = |window: i32, tile: i32| {
        let windows = shared::windows::Constants { window, tile, ..Default::default() };
        code::<shaders::guided_rows::Bind>(&windows.entries()).per_thread(&[1]).count
    };
    let (narrow, wide) = (count(17, 8), count(33, 8));
    assert!(narrow < wide && wide < 2 * narrow, "two groups more add to every window: {narrow} {wide}");
    let told = |tiles| code::<shaders::guided_rows::Bind>(&[]).per_thread(&[tiles]).count;
    assert_eq!(told(3) - told(2), told(2) - told(1));
    assert!(code::<shaders::guided_rows::Bind>(&[]).per_thread(&[]).is_least, "whoever is not told counts once");
}

#[test]
fn a_step_through_the_hierarchy_tests_eight_children() {
    let step = code::<shaders::path::Bind>(&Effects { clear_walls: false, ..Effects::ALL }.entries()).largest_step();
    // About forty operations for each box.
    assert!((8 * 30..8 * 300).contains(&step), "{step}");
}

#[test]
fn damaged_code_is_no_code() {
    let spirv = <ceiling_arithmetic::Bind as Bindings>::SPIRV;
    assert!(Code::new(&[], &[]).is_none() && Code::new(&spirv[4..], &[]).is_none());
    for end in (0..spirv.len()).step_by(4) {
        let _ = Code::new(&spirv[..end], &[]); // whatever it is, it does not panic
    }
}
