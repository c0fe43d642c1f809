//! The trees against those of obvhs, and how long they take.
use super::*;
use glam::Vec3A;
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};

fn scattered(count: usize, seed: u64) -> Vec<Aabb> {
    let mut random = fastrand::Rng::with_seed(seed);
    let mut point = |scale: f32| Vec3A::from([0; 3].map(|_| random.f32() * scale));
    let one = |i: usize| {
        let (low, size) = (point(8.0) + 3.0, point(if i.is_multiple_of(5) { 0.0 } else { 0.3 }));
        Aabb::new(low, low + size)
    };
    (0..count).map(one).collect()
}

/// Boxes that share a corner, each in the next.
fn nested(count: usize) -> Vec<Aabb> {
    (0..count).map(|i| Aabb::new(Vec3A::ZERO, Vec3A::new(1.0, 1.0, 0.0) * (1.0 + i as f32 * 1e-5))).collect()
}

fn with_threads(threads: usize, boxes: &[Aabb]) -> (Bvh2, usize) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| paired(boxes))
}

fn bytes(bvh: &Bvh2) -> &[u8] {
    bytemuck::cast_slice(&bvh.nodes)
}

#[test]
fn trees_are_those_of_obvhs_for_any_number_of_threads() {
    for (seed, count) in (0..).zip([0, 1, 2, 3, 4, 9, 100, 2000, 3 * CHUNK + 1, LARGE]) {
        let boxes = scattered(count, seed);
        let indices = (0..count as u32).collect();
        let mut builder = PlocBuilder::with_capacity(count);
        let peer = builder.build(PlocSearchDistance::Low, &boxes, indices, SortPrecision::U64, QUICK);
        for (bvh, visits) in [1, 3].map(|threads| with_threads(threads, &boxes)) {
            assert!(bytes(&bvh) == bytes(&peer), "{count} boxes");
            assert_eq!((bvh.primitive_indices, bvh.max_depth), (peer.primitive_indices.clone(), peer.max_depth));
            assert!(visits <= PATIENCE / 2 * count, "{visits} visits of {count} boxes");
        }
    }
}

/// Without help each round merges a few of them, and a box is visited some thousand times.
#[test]
fn nested_boxes_take_no_longer_than_others() {
    for count in [100, 2000, 30_000] {
        let boxes = nested(count);
        let [(bvh, visits), (other, _)] = [1, 3].map(|threads| with_threads(threads, &boxes));
        assert!(bytes(&bvh) == bytes(&other), "{count} boxes");
        assert!(visits <= (PATIENCE + 6) * count, "{visits} visits of {count} boxes");
        let mut seen: Vec<_> = bvh.nodes.iter().filter(|node| node.is_leaf()).map(|node| node.first_index).collect();
        seen.sort_unstable();
        assert!(seen.into_iter().eq(0..count as u32), "nothing is lost");
    }
}
