//! A plain traversal of our nodes against brute force, both in 64-bit arithmetic.
use super::super::hierarchy::instance;
use super::*;
use crate::layout::TRAVERSAL_STACK;
use glam::{DAffine3, DVec3};

struct Random(fastrand::Rng);

impl Random {
    fn new(seed: u64) -> Self {
        Self(fastrand::Rng::with_seed(seed))
    }

    /// Uniform in [-1, 1)^3.
    fn point(&mut self) -> DVec3 {
        DVec3::from([0; 3].map(|_| 2.0 * self.0.f64() - 1.0))
    }
}

/// Distance along the ray (Möller and Trumbore 1997).
fn hit(t: &Triangle, origin: DVec3, direction: DVec3) -> Option<f64> {
    let [a, b, c] = [t.v0, t.v1, t.v2].map(|p| Vec3::from(p).as_dvec3());
    let (e1, e2) = (b - a, c - a);
    let p = direction.cross(e2);
    let det = e1.dot(p);
    let s = origin - a;
    let q = s.cross(e1);
    let (u, v, distance) = (s.dot(p) / det, direction.dot(q) / det, e2.dot(q) / det);
    (det != 0.0 && u >= 0.0 && v >= 0.0 && u + v <= 1.0 && distance > 0.0).then_some(distance)
}

fn bytes(words: [u32; 2]) -> [u8; 8] {
    bytemuck::cast(words)
}

/// Box of child `i`, as the kernel decodes it.
fn child_box(n: &BvhNode, i: usize) -> (DVec3, DVec3) {
    let e = n.e_imask.to_le_bytes();
    let scale = DVec3::from([0, 1, 2].map(|a| f64::from(f32::from_bits(u32::from(e[a]) << 23))));
    let q = |words: [[u32; 2]; 3]| DVec3::from(words.map(|w| f64::from(bytes(w)[i])));
    let p = Vec3::from(n.p).as_dvec3();
    (p + q([n.min_x, n.min_y, n.min_z]) * scale, p + q([n.max_x, n.max_y, n.max_z]) * scale)
}

fn crosses((low, high): (DVec3, DVec3), origin: DVec3, direction: DVec3) -> bool {
    let (a, b) = ((low - origin) / direction, (high - origin) / direction);
    a.min(b).max_element().max(0.0) <= a.max(b).min_element()
}

/// Calls `leaf` with every primitive whose box the ray crosses.
fn traverse(nodes: &[BvhNode], root: u32, origin: DVec3, direction: DVec3, leaf: &mut dyn FnMut(u32)) {
    let mut stack = vec![root];
    while let Some(index) = stack.pop() {
        let node = &nodes[index as usize];
        let inner_mask = node.e_imask >> 24;
        for (i, meta) in bytes(node.meta).into_iter().enumerate() {
            if meta == 0 || !crosses(child_box(node, i), origin, direction) {
                continue;
            }
            if inner_mask >> i & 1 == 1 {
                stack.push(node.child_base + (inner_mask & ((1 << i) - 1)).count_ones());
            } else {
                let first = node.primitive_base + u32::from(meta & 31);
                (first..first + (meta >> 5).count_ones()).for_each(&mut *leaf);
            }
        }
    }
}

fn random_geometry(count: usize, size: f64, random: &mut Random) -> Geometry {
    let mut geometry = Geometry::default();
    for primitive in 0..count as u32 {
        let center = random.point();
        let [v0, v1, v2] = [0; 3].map(|_| (center + random.point() * size).as_vec3().to_array());
        geometry.triangles.push(Triangle { v0, v1, v2, primitive, ..Triangle::default() });
    }
    geometry
}

fn closest(hits: impl Iterator<Item = f64>) -> f64 {
    hits.fold(f64::INFINITY, f64::min)
}

fn compare(geometry: &Geometry, nodes: &[BvhNode], root: u32, range: Range<usize>, random: &mut Random) -> usize {
    let mut wrong = 0;
    for _ in 0..500 {
        let (origin, direction) = (random.point() * 2.0, random.point());
        let mut found = f64::INFINITY;
        traverse(nodes, root, origin, direction, &mut |i| {
            let distance = hit(&geometry.triangles[i as usize], origin, direction).unwrap_or(f64::INFINITY);
            found = found.min(distance);
        });
        let all = geometry.triangles[range.clone()].iter().filter_map(|t| hit(t, origin, direction));
        wrong += usize::from(found != closest(all));
    }
    wrong
}

#[test]
fn every_size_agrees_with_brute_force() {
    let mut random = Random::new(1);
    for count in [1, 2, 3, 4, 9, 100, 5000] {
        let mut geometry = random_geometry(count, 0.2, &mut random);
        let mut nodes = Vec::new();
        let root = build_mesh(&mut geometry, 0..count, &mut nodes).0;
        assert_eq!(compare(&geometry, &nodes, root, 0..count, &mut random), 0, "{count} triangles");
        let mut seen: Vec<_> = geometry.triangles.iter().map(|t| t.primitive).collect();
        seen.sort_unstable();
        assert!(seen.into_iter().eq(0..count as u32), "reordering loses nothing");
    }
}

#[test]
fn the_comparison_can_fail() {
    let mut random = Random::new(2);
    let mut geometry = random_geometry(1000, 0.3, &mut random);
    let mut nodes = Vec::new();
    let root = build_mesh(&mut geometry, 0..1000, &mut nodes).0;
    let shrink = |words: [u32; 2]| bytemuck::cast(bytes(words).map(|b| b.saturating_sub(60)));
    nodes.iter_mut().for_each(|n| n.max_x = shrink(n.max_x));
    assert!(compare(&geometry, &nodes, root, 0..1000, &mut random) > 0);
}

#[test]
fn two_meshes_share_the_arrays() {
    let mut random = Random::new(3);
    let mut geometry = random_geometry(300, 0.3, &mut random);
    let mut nodes = Vec::new();
    let roots = [build_mesh(&mut geometry, 0..100, &mut nodes).0, build_mesh(&mut geometry, 100..300, &mut nodes).0];
    assert_eq!(compare(&geometry, &nodes, roots[0], 0..100, &mut random), 0);
    assert_eq!(compare(&geometry, &nodes, roots[1], 100..300, &mut random), 0);
    assert!(compare(&geometry, &nodes, roots[1], 0..300, &mut random) > 0, "control: the second BVH lacks the first");
}

#[test]
fn instances_are_found_through_the_top_level() {
    let mut random = Random::new(4);
    let mut geometry = random_geometry(50, 0.5, &mut random);
    let mut nodes = Vec::new();
    let root = build_mesh(&mut geometry, 0..50, &mut nodes).0;
    let object = bounds(&geometry.triangles).unwrap();
    let places: Vec<_> = (0..40).map(|_| DAffine3::from_scale(random.point() * 0.2)).collect();
    let mut instances: Vec<_> =
        places.iter().map(|a| instance(&(DAffine3::from_translation(random.point()) * *a), root)).collect();
    let top = build_top(&mut instances, &vec![object; 40], &mut nodes, LEVELS).0;
    for _ in 0..300 {
        let (origin, direction) = (random.point() * 2.0, random.point());
        let in_object = |i: &Instance| {
            let rows = [i.object0, i.object1, i.object2].map(|r| Vec4::from(r).as_dvec4());
            let p = |v: DVec3, w: f64| DVec3::from(rows.map(|r| r.truncate().dot(v) + r.w * w));
            (p(origin, 1.0), p(direction, 0.0))
        };
        let nearest = |i: &Instance| {
            let (o, d) = in_object(i);
            closest(geometry.triangles.iter().filter_map(|t| hit(t, o, d)))
        };
        let mut found = f64::INFINITY;
        traverse(&nodes, top, origin, direction, &mut |i| found = found.min(nearest(&instances[i as usize])));
        assert_eq!(found, closest(instances.iter().map(nearest)));
    }
}

#[test]
fn empty_geometry_builds() {
    let (mut geometry, mut nodes) = (Geometry::default(), Vec::new());
    let root = build_mesh(&mut geometry, 0..0, &mut nodes).0;
    assert_eq!((stack_size(&nodes, root, &[]), depth(&nodes, root)), (1, 1));
    let mut leaves = 0;
    traverse(&nodes, root, DVec3::ZERO, DVec3::ONE, &mut |_| leaves += 1);
    assert_eq!(leaves, 0);
}

/// A triangle of the unit size times `size` around `center`; `turn` rolls its corners.
fn around(center: DVec3, size: f64, turn: usize, primitive: u32) -> Triangle {
    let mut v = [DVec3::new(-1.0, -1.0, 0.3), DVec3::new(1.0, -1.0, -0.3), DVec3::new(0.0, 1.0, 0.0)];
    v.rotate_left(turn);
    let [v0, v1, v2] = v.map(|p| (center + p * size).as_vec3().to_array());
    Triangle { v0, v1, v2, primitive, ..Triangle::default() }
}

fn builds_flat(geometry: &mut Geometry) -> (Vec<BvhNode>, u32) {
    let (count, mut nodes) = (geometry.triangles.len(), Vec::new());
    let root = build_mesh(geometry, 0..count, &mut nodes).0;
    // Eight-way, ten levels hold 8^10 leaves; twice that is far from a chain.
    assert!(depth(&nodes, root) <= 20, "{} levels", depth(&nodes, root));
    assert!(stack_size(&nodes, root, &[]) <= TRAVERSAL_STACK);
    let mut seen: Vec<_> = geometry.triangles.iter().map(|t| t.primitive).collect();
    seen.sort_unstable();
    assert!(seen.into_iter().eq(0..count as u32), "nothing is lost");
    (nodes, root)
}

#[test]
fn coincident_triangles_make_a_flat_tree() {
    let triangles = (0..200_000).map(|i| around(DVec3::ONE, 0.5, i as usize % 3, i)).collect();
    let mut geometry = Geometry { triangles, ..Geometry::default() };
    let (nodes, root) = builds_flat(&mut geometry);
    let mut leaves = 0;
    traverse(&nodes, root, DVec3::new(1.0, 1.0, 9.0), DVec3::new(1e-9, 1e-9, -1.0), &mut |_| leaves += 1);
    assert_eq!(leaves, 200_000, "a ray through the middle meets them all");
}

#[test]
fn concentric_and_coincident_triangles_among_others_are_found() {
    let mut random = Random::new(5);
    let mut geometry = random_geometry(2000, 0.1, &mut random);
    for i in 0..3000 {
        let (center, size) = if i % 2 == 0 { (DVec3::ZERO, 1e-3 * f64::from(i)) } else { (DVec3::splat(0.5), 0.2) };
        geometry.triangles.push(around(center, size + 1e-4, 0, 2000 + i));
    }
    let (nodes, root) = builds_flat(&mut geometry);
    assert_eq!(compare(&geometry, &nodes, root, 0..5000, &mut random), 0);
}

/// The halves of a square have one box, and with it a centre.
#[test]
fn squares_lose_neither_half() {
    let mut random = Random::new(10);
    let corner = |i: u32, dx: u32, dy: u32| [(i % 80 + dx) as f32, (i / 80 + dy) as f32, 0.5].map(|v| v / 40.0 - 1.0);
    let half = |i: u32, turn: u32| {
        let (v1, primitive) = (corner(i, turn, 1 - turn), 2 * i + turn);
        Triangle { v0: corner(i, 0, 0), v1, v2: corner(i, 1, 1), primitive, ..Triangle::default() }
    };
    let triangles = (0..6400).flat_map(|i| [0, 1].map(|turn| half(i, turn))).collect();
    let mut geometry = Geometry { triangles, ..Geometry::default() };
    let (nodes, root) = builds_flat(&mut geometry);
    assert_eq!(compare(&geometry, &nodes, root, 0..12_800, &mut random), 0);
}

#[test]
fn coincident_instances_make_a_flat_tree() {
    let mut random = Random::new(6);
    let mut geometry = random_geometry(9, 0.5, &mut random);
    let mut nodes = Vec::new();
    let root = build_mesh(&mut geometry, 0..9, &mut nodes).0;
    let mut instances = vec![instance(&DAffine3::IDENTITY, root); 50_000];
    let object = bounds(&geometry.triangles).unwrap();
    let top = build_top(&mut instances, &vec![object; 50_000], &mut nodes, LEVELS).0;
    assert!(stack_size(&nodes, top, &instances) <= TRAVERSAL_STACK);
}

/// Thin triangles from one corner to the pieces of a line: boxes inside boxes.
#[test]
fn a_fan_makes_a_flat_tree() {
    let mut random = Random::new(7);
    let mut geometry = random_geometry(500, 0.1, &mut random);
    let step = |i: u32| [f32::from(i as u16) / 1000.0 - 1.0, 1.0, 0.0];
    geometry.triangles.extend((0..2000).map(|i| Triangle {
        v0: [-1.0, -1.0, 0.0],
        v1: step(i),
        v2: step(i + 1),
        primitive: 500 + i,
        ..Triangle::default()
    }));
    let (nodes, root) = builds_flat(&mut geometry);
    assert_eq!(compare(&geometry, &nodes, root, 0..2500, &mut random), 0);
    let mut instances = vec![instance(&DAffine3::IDENTITY, root); 2000];
    let nested: Vec<_> = (1..=2000).map(|i| [[0.0; 3], [i as f32, 1.0, 1.0]]).collect();
    let mut nodes = nodes;
    let top = build_top(&mut instances, &nested, &mut nodes, LEVELS).0;
    assert!(stack_size(&nodes, top, &instances) <= TRAVERSAL_STACK, "two levels of fans");
}

#[test]
fn a_refitted_tree_finds_what_has_moved() {
    let mut random = Random::new(8);
    let mut geometry = random_geometry(1000, 0.2, &mut random);
    let mut nodes = Vec::new();
    let (root, _) = build_mesh(&mut geometry, 0..1000, &mut nodes);
    for scale in [1.0, 0.01, 300.0] {
        for t in &mut geometry.triangles {
            let by = (random.point() * 0.3 * scale).as_vec3();
            let moved = |p: [f32; 3]| (Vec3::from(p) * scale as f32 + by).to_array();
            (t.v0, t.v1, t.v2) = (moved(t.v0), moved(t.v1), moved(t.v2));
        }
        let boxes: Vec<_> = geometry.triangles.iter().map(Boundable::aabb).collect();
        let all = 0..nodes.len();
        refit(&mut nodes, all, |i| boxes[i as usize]);
        assert_eq!(compare(&geometry, &nodes, root, 0..1000, &mut random), 0);
    }
    let lost = geometry.triangles[0];
    geometry.triangles.iter_mut().for_each(|t| t.v0 = [9e3; 3]);
    assert!(compare(&geometry, &nodes, root, 0..1000, &mut random) > 0, "control: {lost:?} and others moved on");
}

#[test]
fn the_shallowest_tree_is_as_deep_as_its_number_needs() {
    let mut random = Random::new(9);
    for (count, levels) in [(1, 1), (24, 1), (25, 2), (192, 2), (193, 3), (1000, 3)] {
        let mut geometry = random_geometry(count, 0.2, &mut random);
        let mut nodes = Vec::new();
        let (root, order) = build(&geometry.triangles, 0, &mut nodes, 0);
        reorder(&mut geometry.triangles, &order);
        assert_eq!(depth(&nodes, root), levels, "{count}");
        assert_eq!(compare(&geometry, &nodes, root, 0..geometry.triangles.len(), &mut random), 0, "{count}");
    }
}

#[test]
fn a_hierarchy_reaches_as_far_as_its_triangles() {
    let mut random = Random::new(5);
    for count in [1, 7, 300, 5000] {
        let mut triangles: Vec<_> = (0..count)
            .map(|i| {
                let at = random.point() * 9.0;
                let corner = |random: &mut Random| (at + random.point()).as_vec3().to_array();
                let [v0, v1, v2] = [(); 3].map(|()| corner(&mut random));
                let sphere = if i % 5 == 4 { crate::layout::SPHERE } else { 0 };
                Triangle { v0, v1, v2, primitive: sphere, ..Triangle::default() }
            })
            .collect();
        let mut nodes = Vec::new();
        let (root, order) = build(&triangles, 0, &mut nodes, LEVELS);
        reorder(&mut triangles, &order);
        for _ in 0..200 {
            let direction = (random.point() * 10.0).as_vec3();
            assert_eq!(farthest(&nodes, root, &triangles, direction), along(&triangles, direction));
        }
    }
}
