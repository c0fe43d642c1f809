//! The nodes against those that obvhs makes of the same tree.
use super::*;
use obvhs::cwbvh::bvh2_to_cwbvh::bvh2_to_cwbvh;
use obvhs::cwbvh::node::CwBvhNode;
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};

/// A tree over boxes of random places and sizes, some of them flat or equal.
fn tree(count: usize, seed: u64) -> Bvh2 {
    let mut random = fastrand::Rng::with_seed(seed);
    let boxes: Vec<_> = (0..count)
        .map(|i| {
            let mut point = || Vec3A::from([0; 3].map(|_| random.f32()));
            let (at, size) = (point() * 8.0, point() * if i % 5 == 0 { 0.0 } else { 0.3 });
            if i % 97 == 0 { Aabb::new(Vec3A::ONE, Vec3A::ONE) } else { Aabb::new(at, at + size) }
        })
        .collect();
    let indices = (0..count as u32).collect();
    PlocBuilder::new().build(PlocSearchDistance::Low, &boxes, indices, SortPrecision::U64, 2)
}

fn node_of(n: &CwBvhNode) -> BvhNode {
    let [x, y, z] = n.e;
    BvhNode {
        p: n.p.into(),
        e_imask: u32::from_le_bytes([x, y, z, n.imask]),
        child_base: n.child_base_idx,
        primitive_base: n.primitive_base_idx,
        meta: bytemuck::cast(n.child_meta),
        min_x: bytemuck::cast(n.child_min_x),
        max_x: bytemuck::cast(n.child_max_x),
        min_y: bytemuck::cast(n.child_min_y),
        max_y: bytemuck::cast(n.child_max_y),
        min_z: bytemuck::cast(n.child_min_z),
        max_z: bytemuck::cast(n.child_max_z),
        ..Default::default()
    }
}

#[test]
fn nodes_are_those_of_obvhs_for_any_number_of_threads() {
    for (seed, count) in (0..).zip([1, 2, 3, 4, 9, 100, 2000, 3 * SMALL]) {
        let bvh2 = tree(count, seed);
        let peer = bvh2_to_cwbvh(&bvh2, LEAF, true, false);
        let nodes: Vec<_> = peer.nodes.iter().map(node_of).collect();
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let wide = pool.install(|| collapse(&bvh2, 1000)).unwrap();
            let apart = wide.nodes.iter().zip(&nodes).position(|(a, b)| bytemuck::bytes_of(a) != bytemuck::bytes_of(b));
            assert_eq!((wide.nodes.len(), apart), (nodes.len(), None), "{count} boxes");
            assert_eq!(wide.order, peer.primitive_indices, "{count} boxes");
            assert_eq!(wide.levels, super::super::depth(&wide.nodes, 0), "{count} boxes");
        }
    }
}

#[test]
fn trees_that_are_too_deep_are_refused() {
    let height = |most| collapse(&tree(100, 1), most).is_some();
    let least = (0..100).find(|&most| height(most)).unwrap();
    assert!((7..40).contains(&least) && !height(least - 1) && height(least + 1), "{least}");
}
