//! Worked examples: small modules and what is left of them.
use super::*;
use crate::gpu::Bindings;
use crate::layout::Effects;
use crate::shaders::path;

// Ids of the examples: a type of booleans and one of 32-bit integers, a specialisation constant and two numbers.
const BOOL: u32 = 1;
const UINT: u32 = 2;
const CHOICE: u32 = 3;
const TEN: u32 = 4;
const TWENTY: u32 = 36;
const ENTRY: u32 = 6;
const BOUND_OF_IDS: u32 = 40;
const NO_CONTRACTION: u32 = 42;

type Line<'a> = (u16, &'a [u32]);

/// A module of one function whose blocks are `body`, with `choice` as it is declared before and after, as [`compact`] numbers it.
fn expected(bound: u32, before: &[Line], choice: u16, more: &[Line], body: &[Line]) -> Vec<u32> {
    compact(&module(bound, before, choice, more, body)).unwrap()
}

/// The same as it is written.
fn module(bound: u32, before: &[Line], choice: u16, more: &[Line], body: &[Line]) -> Vec<u32> {
    let declared: [Line; 5] = [
        (op::TYPE_BOOL, &[BOOL]),
        (op::TYPE_INT, &[UINT, 32, 0]),
        (choice, &[BOOL, CHOICE]),
        (op::CONSTANT, &[UINT, TEN, 10]),
        (op::CONSTANT, &[UINT, TWENTY, 20]),
    ];
    let function: [Line; 1] = [(op::FUNCTION, &[30, 31, 0, 32])];
    let end: [Line; 1] = [(op::FUNCTION_END, &[])];
    let lines = [before, &declared, more, &function, body, &end].concat();
    let header = [0x0723_0203, 0x0001_0600, 0, bound, 0];
    let mut whole = header.to_vec();
    lines.iter().for_each(|&(opcode, words)| Instruction { opcode, words }.write(&mut whole));
    whole
}

/// `body` with the choice made, beside the module that is expected of it.
fn assert_becomes(choice: bool, body: &[Line], undefined: Option<u32>, left: &[Line]) {
    let code = module(BOUND_OF_IDS, &[(op::DECORATE, &[CHOICE, SPEC_ID, 7])], op::SPEC_CONSTANT_FALSE, &[], body);
    let set = if choice { op::CONSTANT_TRUE } else { op::CONSTANT_FALSE };
    let operands = undefined.map(|kind| [kind, BOUND_OF_IDS]);
    let more: Vec<Line> = operands.iter().map(|operands| (op::UNDEF, &operands[..])).collect();
    let left = expected(BOUND_OF_IDS + more.len() as u32, &[], set, &more, left);
    assert_eq!(specialise(&code, &[(6, 1), (7, choice.into())]), left);
    if !choice {
        assert_eq!(specialise(&code, &[]), left, "the default");
    }
}

/// `if (choice) x = 10; else x = 10 + 20; if (x == 10) {}`
const SELECTIONS: [Line; 16] = [
    (op::LABEL, &[ENTRY]),
    (op::SELECTION_MERGE, &[9, 0]),
    (op::BRANCH_CONDITIONAL, &[CHOICE, 7, 8]),
    (op::LABEL, &[7]),
    (op::BRANCH, &[9]),
    (op::LABEL, &[8]),
    (op::I_ADD, &[UINT, 20, TEN, TWENTY]),
    (op::BRANCH, &[9]),
    (op::LABEL, &[9]),
    (op::PHI, &[UINT, 21, TEN, 7, 20, 8]),
    (op::I_EQUAL, &[BOOL, 22, 21, TEN]),
    (op::SELECTION_MERGE, &[11, 0]),
    (op::BRANCH_CONDITIONAL, &[22, 10, 11]),
    (op::LABEL, &[10]),
    (op::BRANCH, &[11]),
    (op::LABEL, &[11]),
];

#[test]
fn what_a_constant_decides_by_way_of_phis_is_gone() {
    let body = [&SELECTIONS[..], &[(op::RETURN, &[])]].concat();
    let chosen: [Line; 12] = [
        (op::LABEL, &[ENTRY]),
        (op::BRANCH, &[7]),
        (op::LABEL, &[7]),
        (op::BRANCH, &[9]),
        (op::LABEL, &[9]),
        (op::PHI, &[UINT, 21, TEN, 7]),
        (op::I_EQUAL, &[BOOL, 22, 21, TEN]),
        (op::BRANCH, &[10]),
        (op::LABEL, &[10]),
        (op::BRANCH, &[11]),
        (op::LABEL, &[11]),
        (op::RETURN, &[]),
    ];
    assert_becomes(true, &body, None, &chosen);
    let other: [Line; 11] = [
        (op::LABEL, &[ENTRY]),
        (op::BRANCH, &[8]),
        (op::LABEL, &[8]),
        (op::I_ADD, &[UINT, 20, TEN, TWENTY]),
        (op::BRANCH, &[9]),
        (op::LABEL, &[9]),
        (op::PHI, &[UINT, 21, 20, 8]),
        (op::I_EQUAL, &[BOOL, 22, 21, TEN]),
        (op::BRANCH, &[11]),
        (op::LABEL, &[11]),
        (op::RETURN, &[]),
    ];
    assert_becomes(false, &body, None, &other);
}

#[test]
fn decorations_go_with_what_they_decorate() {
    let body = [&SELECTIONS[..], &[(op::RETURN, &[])]].concat();
    let before: [Line; 2] = [(op::DECORATE, &[20, NO_CONTRACTION]), (op::DECORATE, &[21, NO_CONTRACTION])];
    let count = |choice| {
        let code = specialise(&module(BOUND_OF_IDS, &before, choice, &[], &body), &[]);
        instructions(&code).unwrap().iter().filter(|i| i.opcode == op::DECORATE).count()
    };
    assert_eq!([op::SPEC_CONSTANT_TRUE, op::SPEC_CONSTANT_FALSE].map(count), [1, 2]);
}

#[test]
fn loops_keep_their_form() {
    // `for (uint x = 10;; x += 10) { if (choice) break; }`
    let body: [Line; 12] = [
        (op::LABEL, &[ENTRY]),
        (op::BRANCH, &[7]),
        (op::LABEL, &[7]),
        (op::PHI, &[UINT, 20, TEN, ENTRY, 21, 9]),
        (op::LOOP_MERGE, &[10, 9, 0]),
        (op::BRANCH_CONDITIONAL, &[CHOICE, 10, 9]),
        (op::LABEL, &[9]),
        (op::I_ADD, &[UINT, 21, 20, TEN]),
        (op::BRANCH, &[7]),
        (op::LABEL, &[10]),
        (op::PHI, &[UINT, 22, 20, 7]),
        (op::RETURN, &[]),
    ];
    let mut left = body.to_vec();
    left[3] = (op::PHI, &[UINT, 20, TEN, ENTRY, BOUND_OF_IDS, 9]);
    left[5] = (op::BRANCH, &[10]);
    left.remove(7);
    assert_becomes(true, &body, Some(UINT), &left);
    let mut endless = body.to_vec();
    endless[5] = (op::BRANCH, &[9]);
    endless.splice(10.., [(op::UNREACHABLE, &[][..])]);
    assert_becomes(false, &body, None, &endless);

    // `do {} while (choice);`: the branch that closes a loop stays.
    let once: [Line; 8] = [
        (op::LABEL, &[ENTRY]),
        (op::BRANCH, &[7]),
        (op::LABEL, &[7]),
        (op::LOOP_MERGE, &[10, 9, 0]),
        (op::BRANCH, &[9]),
        (op::LABEL, &[9]),
        (op::BRANCH_CONDITIONAL, &[CHOICE, 7, 10]),
        (op::LABEL, &[10]),
    ];
    let once = [&once[..], &[(op::RETURN, &[])]].concat();
    assert_becomes(false, &once, None, &once);
}

#[test]
fn a_selection_that_others_leave_early_stays_one() {
    // `if (choice) { if (varying) leave; }`, where `leave` branches to the end of the outer selection.
    let body: [Line; 11] = [
        (op::LABEL, &[ENTRY]),
        (op::SELECTION_MERGE, &[10, 0]),
        (op::BRANCH_CONDITIONAL, &[CHOICE, 7, 9]),
        (op::LABEL, &[7]),
        (op::SELECTION_MERGE, &[8, 0]),
        (op::BRANCH_CONDITIONAL, &[33, 10, 8]),
        (op::LABEL, &[8]),
        (op::BRANCH, &[10]),
        (op::LABEL, &[9]),
        (op::BRANCH, &[10]),
        (op::LABEL, &[10]),
    ];
    let body = [&body[..], &[(op::RETURN, &[])]].concat();
    let mut left = body.clone();
    left[9] = (op::UNREACHABLE, &[]);
    assert_becomes(true, &body, None, &left);
}

#[test]
fn numbers_are_set_and_computed_with() {
    let before: [Line; 1] = [(op::DECORATE, &[33, SPEC_ID, 8])];
    let choice: [Line; 3] = [
        (op::SPEC_CONSTANT, &[UINT, 33, 1]),
        (op::SPEC_CONSTANT_OP, &[UINT, 34, op::I_ADD.into(), 33, TEN]),
        (op::SPEC_CONSTANT_OP, &[BOOL, 35, op::U_LESS_THAN.into(), 34, TWENTY]),
    ];
    let code = specialise(&module(BOUND_OF_IDS, &before, op::CONSTANT_TRUE, &choice, &[]), &[(8, 9)]);
    let set: [Line; 3] =
        [(op::CONSTANT, &[UINT, 33, 9]), (op::CONSTANT, &[UINT, 34, 19]), (op::CONSTANT_TRUE, &[BOOL, 35])];
    assert_eq!(code, expected(BOUND_OF_IDS, &[], op::CONSTANT_TRUE, &set, &[]));
}

/// `if (choice) shuffle(10, gl_SubgroupInvocationID);`
#[test]
fn what_only_subgroups_need_goes_with_them() {
    const SHADER: u32 = 1;
    const SHUFFLE: u16 = 345;
    // The number of the execution model GLCompute: a word of an entry point is an id by its place.
    const VARIABLE: u32 = 5;
    const NAME_OF_MAIN: u32 = 0x6e69_616d;
    let before = |lanes: bool| {
        let of_lanes: [Line; 4] = [
            (op::CAPABILITY, &[GROUP_NON_UNIFORM]),
            (op::ENTRY_POINT, &[5, 31, NAME_OF_MAIN, 0, 34, VARIABLE]),
            (op::NAME, &[VARIABLE, 0]),
            (op::DECORATE, &[VARIABLE, BUILT_IN, SUBGROUP_LOCAL_INVOCATION_ID]),
        ];
        let without: [Line; 1] = [(op::ENTRY_POINT, &[5, 31, NAME_OF_MAIN, 0, 34])];
        let used: [Line; 1] = [(op::CAPABILITY, &[SHADER])];
        [&used[..], if lanes { &of_lanes } else { &without }].concat()
    };
    let variables: [Line; 2] = [(op::VARIABLE, &[35, VARIABLE, 1]), (op::VARIABLE, &[35, 34, 1])];
    let body: [Line; 8] = [
        (op::LABEL, &[ENTRY]),
        (op::SELECTION_MERGE, &[8, 0]),
        (op::BRANCH_CONDITIONAL, &[CHOICE, 7, 8]),
        (op::LABEL, &[7]),
        (op::LOAD, &[UINT, 20, VARIABLE]),
        (SHUFFLE, &[UINT, 21, TEN, TEN, 20]),
        (op::BRANCH, &[8]),
        (op::LABEL, &[8]),
    ];
    let code = module(BOUND_OF_IDS, &before(true), op::SPEC_CONSTANT_FALSE, &variables, &body);
    let left: [Line; 3] = [(op::LABEL, &[ENTRY]), (op::BRANCH, &[8]), (op::LABEL, &[8])];
    let alone = expected(BOUND_OF_IDS, &before(false), op::CONSTANT_FALSE, &variables[1..], &left);
    assert_eq!(specialise(&code, &[]), alone);
    let code = module(BOUND_OF_IDS, &before(true), op::SPEC_CONSTANT_TRUE, &variables, &body);
    let kept = [&[(op::LABEL, &[ENTRY][..]), (op::BRANCH, &[7])], &body[3..]].concat();
    assert_eq!(specialise(&code, &[]), expected(BOUND_OF_IDS, &before(true), op::CONSTANT_TRUE, &variables, &kept));
}

/// What a scene lacks leaves nothing in the path tracer: without effects it is less than a sixth of what it is with all.
#[test]
fn the_path_tracer_without_effects_is_small() {
    let code: Vec<u32> = bytemuck::pod_collect_to_vec(path::Bind::SPIRV);
    let size = |effects| specialise(&code, &path::Constants { effects, ..path::Constants::default() }.entries()).len();
    let [none, all] = [Effects::default(), Effects::ALL].map(size);
    assert!(6 * none < all && all <= code.len(), "{none} {all} {}", code.len());
}
