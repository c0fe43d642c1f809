//! Compares the kernels that measure what a device can do with their CPU twins.
use crate::support::kernels::{ceiling_arithmetic, ceiling_copy};
use crate::support::{assert_silent, gpu, words};
use tallow::gpu::{Buffer, FrameResources, Kernel, Location};
use tallow::layout::vec4;
use tallow::profile::ceilings;

#[test]
fn a_copy_has_every_bit_and_ends_where_it_is_told() {
    let gpu = gpu();
    let kernel = Kernel::new(&gpu, &gpu.tuning().thread().into()).unwrap();
    for elements in [1, 31, 32, 33, 4097] {
        let small = |word: u32| (word & 0xff_ffff) as f32;
        let from: Vec<vec4> =
            words(4 * elements, 7).chunks_exact(4).map(|w| [0, 1, 2, 3].map(|i| small(w[i]))).collect();
        let source = Buffer::from_slice(&gpu, "source", &from).unwrap();
        let target = Buffer::from_slice(&gpu, "target", &vec![[-1.0; 4]; elements + 1]).unwrap();
        let bind = ceiling_copy::Bind { source: &source, target: &target };
        let threads = elements as u32;
        gpu.run(&mut FrameResources::new(&gpu).unwrap(), |rec| rec.dispatch_threads(&kernel, bind, &threads, threads))
            .unwrap();
        let copied = target.read().unwrap();
        assert_eq!(copied[..elements], from, "{elements} elements");
        assert_eq!(copied[elements], [-1.0; 4], "{elements} elements and no more");
    }
    assert_silent(&gpu);
}

#[test]
fn arithmetic_is_done_and_not_left_out() {
    let gpu = gpu();
    let kernel = Kernel::new(&gpu, &gpu.tuning().thread().into()).unwrap();
    let threads = 1200;
    let result = Buffer::<vec4>::new(&gpu, "result", threads as usize, Location::Device).unwrap();
    let bind = ceiling_arithmetic::Bind { result: &result };
    gpu.run(&mut FrameResources::new(&gpu).unwrap(), |rec| rec.dispatch_threads(&kernel, bind, &threads, threads))
        .unwrap();
    for (i, found) in result.read().unwrap().into_iter().enumerate() {
        // A driver may fuse each multiplication with its addition, which rounds once instead of twice.
        let expected = ceilings::reference(i as u32);
        assert!(
            found.iter().zip(expected).all(|(f, e)| (f - e).abs() <= 1e-6 * e.abs()),
            "{i}: {found:?} {expected:?}"
        );
        assert!(expected[0] > 0.0, "the twin computes something");
    }
    assert_silent(&gpu);
}
