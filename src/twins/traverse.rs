//! Twin of `glsl/shared/traverse.glsl`.
use crate::layout::{BvhNode, NONE, TRAVERSAL_STACK};
use crate::math::octahedral::octahedral_point;
use crate::scene::Scene;
use crate::shaders::shared::segment::{INFINITE_DISTANCE, MASK_HASH, WALL_END, WALL_HALVING};
use crate::shaders::shared::traverse::SLAB_ROUNDING;
use crate::twins::scene::{object_from_world, triangle_vertices};
use crate::twins::sphere::Sphere;
use crate::twins::texture::mask_leaves;
use glam::{UVec3, Vec2, Vec3, vec2, vec3};

/// Where a ray meets the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance in lengths of the ray's direction; the ray's end on a miss.
    pub t: f32,
    /// Index of the triangle in leaf order; [`NONE`] on a miss.
    pub triangle: u32,
    /// Index of the instance; [`NONE`] without instances.
    pub instance: u32,
    /// Weights of vertices 1 and 2; of a sphere, its unit normal as a point of the octahedron.
    pub barycentric: Vec2,
}

impl Hit {
    /// Whether the ray hits anything.
    pub fn any(&self) -> bool {
        self.triangle != NONE
    }
}

const STACK_SIZE: usize = TRAVERSAL_STACK as usize;

/// A ray prepared for the triangle and box tests.
#[derive(Clone, Copy, Debug)]
pub struct RaySpace {
    origin: Vec3,
    direction: Vec3,
    inverse: Vec3,
    shear: Vec3,
    along_x: bool,
    along_y: bool,
    octant: u32,
}

impl RaySpace {
    fn largest_last(&self, v: Vec3) -> Vec3 {
        match (self.along_x, self.along_y) {
            (true, _) => vec3(v.z, v.y, v.x),
            (_, true) => vec3(v.x, v.z, v.y),
            _ => v,
        }
    }
}

/// Prepares a ray, whose `direction` may have any length but 0.
pub fn ray_space(origin: Vec3, direction: Vec3) -> RaySpace {
    let safe = |d: f32| if d.abs() < 1e-20 { 1e-20 } else { d };
    let safe = vec3(safe(direction.x), safe(direction.y), safe(direction.z));
    let size = direction.abs();
    let along_x = size.x > size.y.max(size.z);
    let along_y = !along_x && size.y > size.z;
    let positive = |d: f32| u32::from(d >= 0.0);
    let octant = (positive(safe.x) * 4 + positive(safe.y) * 2 + positive(safe.z)) * 0x01010101;
    let mut r = RaySpace { origin, direction, inverse: 1.0 / safe, shear: Vec3::ZERO, along_x, along_y, octant };
    let along = r.largest_last(r.inverse).z;
    let d = r.largest_last(direction);
    r.shear = vec3(d.x * along, d.y * along, along);
    r
}

/// Distance of the hit in lengths of the ray's direction, and barycentric weights; `None` at or beyond `t_max`.
pub fn intersect_triangle(r: &RaySpace, vertices: [Vec3; 3], t_max: f32) -> Option<(f32, Vec2)> {
    // Written out, as below: builds that hardly optimise call functions for what `map` does, which took most of the time of tests.
    let local = |v: Vec3| r.largest_last(v - r.origin);
    let (a, b, c) = (local(vertices[0]), local(vertices[1]), local(vertices[2]));
    let sheared = |v: Vec3| vec2(v.x - r.shear.x * v.z, v.y - r.shear.y * v.z);
    let (p, q, s) = (sheared(a), sheared(b), sheared(c));
    let u = s.x * q.y - s.y * q.x;
    let v = p.x * s.y - p.y * s.x;
    let w = q.x * p.y - q.y * p.x;
    let det = u + v + w;
    let inside = u.min(v).min(w) >= 0.0 || u.max(v).max(w) <= 0.0;
    let inv = 1.0 / det;
    let t = (u * a.z + v * b.z + w * c.z) * (inv * r.shear.z);
    (inside && det != 0.0 && t > 0.0 && t < t_max).then_some((t, vec2(v, w) * inv))
}

/// Both hits with a sphere, from half its chord: distances in lengths of the ray's direction, and vectors from the centre.
pub fn intersect_sphere(r: &RaySpace, sphere: &Sphere) -> Option<[(f32, Vec3); 2]> {
    let from_centre = r.origin - sphere.centre;
    let inverse = 1.0 / r.direction.length();
    let d = r.direction * inverse;
    let mut along = from_centre.dot(d);
    let mut nearest = from_centre - along * d;
    let rest = nearest.dot(d);
    nearest -= rest * d;
    along += rest;
    let squared = sphere.pole.length_squared() - nearest.length_squared();
    let chord = squared.max(0.0).sqrt();
    (squared >= 0.0).then(|| [-chord, chord].map(|half| ((half - along) * inverse, nearest + half * d)))
}

/// Four children: their planes near and far along the ray, a byte each.
fn intersect_children(
    meta: u32,
    octant: u32,
    near: [u32; 3],
    far: [u32; 3],
    scale: Vec3,
    origin: Vec3,
    t_max: f32,
) -> u32 {
    let inner = ((meta & (meta << 1)) & 0x10101010) >> 4;
    let bit_index = (meta ^ (octant & inner.wrapping_mul(0xff))) & 0x1f1f1f1f;
    let child_bits = (meta >> 5) & 0x07070707;
    let mut mask = 0;
    for i in [0, 8, 16, 24] {
        let plane = |q: u32| ((q >> i) & 0xff) as f32;
        let planes = |q: [u32; 3]| vec3(plane(q[0]), plane(q[1]), plane(q[2])) * scale + origin;
        let (t_near, t_far) = (planes(near), planes(far));
        let bits = |t: f32| t.to_bits() as i32;
        let enter = bits(t_near.x).max(bits(t_near.y)).max(bits(t_near.z)).max(0);
        let leave = bits(t_far.x).min(bits(t_far.y)).min(bits(t_far.z)).min(bits(t_max));
        if enter <= leave + SLAB_ROUNDING {
            mask |= ((child_bits >> i) & 0xff) << ((bit_index >> i) & 0xff);
        }
    }
    mask
}

/// One bit per inner child hit (24 to 31, in order of visit) and one per triangle (0 to 23).
fn intersect_node(r: &RaySpace, n: &BvhNode, t_max: f32) -> u32 {
    let cell = |i: u32| f32::from_bits(((n.e_imask >> i) & 0xff) << 23);
    let scale = vec3(cell(0), cell(8), cell(16)) * r.inverse;
    let origin = (Vec3::from(n.p) - r.origin) * r.inverse;
    let half = |h: usize| {
        let (mut near, mut far) = ([n.min_x[h], n.min_y[h], n.min_z[h]], [n.max_x[h], n.max_y[h], n.max_z[h]]);
        for axis in 0..3 {
            if r.inverse[axis] < 0.0 {
                std::mem::swap(&mut near[axis], &mut far[axis]);
            }
        }
        intersect_children(n.meta[h], r.octant, near, far, scale, origin, t_max)
    };
    half(0) | half(1)
}

/// A base index and, in `1`, bits: inner children hit (high byte) with the mask of inner children, or primitives hit.
type Group = (u32, u32);

fn take_highest(bits: &mut u32) -> u32 {
    let bit = 31 - bits.leading_zeros();
    *bits &= !(1 << bit);
    bit
}

struct Traversal<'a> {
    scene: &'a Scene,
    ray: RaySpace,
    stack: Vec<Group>,
    hit: Hit,
    instance: u32,
    mask_seed: u32,
    from: [u32; 2],
    /// Optical depth of the walls that a shadow ray has passed, by channel.
    wall_depth: UVec3,
}

impl Traversal<'_> {
    /// Whether what the ray meets leaves nothing of its light.
    fn is_stopped(&mut self, index: u32, place: Vec2, seed: u32) -> bool {
        let left = mask_leaves(self.scene, index, self.instance, place, self.ray.direction, seed);
        if left == Vec3::ZERO || left == Vec3::ONE {
            return left == Vec3::ZERO;
        }
        let depth = left.map(|share| (-share.max(1e-9).log2()).clamp(0.0, 24.0) * WALL_HALVING + 0.5).as_uvec3();
        self.wall_depth = (self.wall_depth + depth).min(UVec3::splat(WALL_END));
        self.wall_depth == UVec3::splat(WALL_END)
    }

    fn push(&mut self, group: Group) {
        assert!(self.stack.len() < STACK_SIZE, "the kernel's stack would overflow");
        self.stack.push(group);
    }

    /// Visits the nearest child of `group`: its inner children and its leaves that the ray meets.
    fn visit(&mut self, mut group: Group) -> (Group, Group) {
        let hits = group.1;
        let bit = take_highest(&mut group.1);
        if group.1 > 0x00ffffff {
            self.push(group);
        }
        let slot = (bit - 24) ^ (self.ray.octant & 0xff);
        let child = group.0 + (hits & !(0xffffffff << slot)).count_ones();
        let node = &self.scene.nodes[child as usize];
        let mask = intersect_node(&self.ray, node, self.hit.t);
        ((node.child_base, (mask & 0xff000000) | node.e_imask >> 24), (node.primitive_base, mask & 0x00ffffff))
    }

    /// Goes down into one of the instances of `leaves`, and leaves the rest on the stack.
    fn enter(&mut self, group: Group, mut leaves: Group, origin: Vec3, direction: Vec3) -> Group {
        let bit = take_highest(&mut leaves.1);
        if group.1 > 0x00ffffff {
            self.push(group);
        }
        if leaves.1 != 0 {
            self.push(leaves);
        }
        self.instance = leaves.0 + bit;
        let instance = &self.scene.instances[self.instance as usize];
        let object_from_world = object_from_world(instance);
        self.ray = ray_space(object_from_world.point(origin), object_from_world.vector(direction));
        (instance.root, 0x80000000)
    }

    /// Returns whether the ray meets the sphere. A ray that leaves it meets only its far side; a mask decides on each side.
    fn test_sphere(&mut self, index: u32, sphere: &Sphere) -> bool {
        let Some([near, far]) = intersect_sphere(&self.ray, sphere) else { return false };
        let leaves = [index, self.instance] == self.from;
        let before_end = |t: f32| t > 0.0 && t < self.hit.t;
        let (enters, ends) = (!leaves && before_end(near.0), before_end(far.0));
        let seeds = [self.mask_seed, self.mask_seed ^ MASK_HASH];
        let places = [near.1, far.1].map(octahedral_point);
        let side = match enters && self.is_stopped(index, places[0], seeds[0]) {
            true => 0,
            false if ends && self.is_stopped(index, places[1], seeds[1]) => 1,
            false => return false,
        };
        let t = [near.0, far.0][side];
        self.hit = Hit { t, triangle: index, instance: self.instance, barycentric: places[side] };
        true
    }

    /// Tests triangles; returns true when any hit suffices and one is found.
    fn test(&mut self, mut leaves: Group, any_hit: bool) -> bool {
        while leaves.1 != 0 {
            let index = leaves.0 + take_highest(&mut leaves.1);
            if let Some(sphere) = Sphere::of(self.scene, index) {
                if self.test_sphere(index, &sphere) && any_hit {
                    return true;
                }
                continue;
            }
            if [index, self.instance] == self.from {
                continue;
            }
            let vertices = triangle_vertices(self.scene, index);
            let Some((t, barycentric)) = intersect_triangle(&self.ray, vertices, self.hit.t) else { continue };
            if self.is_stopped(index, barycentric, self.mask_seed) {
                self.hit = Hit { t, triangle: index, instance: self.instance, barycentric };
                if any_hit {
                    return true;
                }
            }
        }
        false
    }

    /// Goes through the scene until nothing is left, or with `any_hit` until something is found.
    fn run(&mut self, origin: Vec3, direction: Vec3, any_hit: bool) {
        let two_levels = !self.scene.instances.is_empty();
        let mut bottom = 0; // stack depth at which the current instance was entered
        let mut group = (self.scene.root, 0x80000000);
        loop {
            let mut leaves = (0, 0);
            if group.1 > 0x00ffffff {
                (group, leaves) = self.visit(group);
            } else if two_levels {
                leaves = std::mem::take(&mut group);
            }
            if two_levels && self.instance == NONE && leaves.1 != 0 {
                group = self.enter(group, leaves, origin, direction);
                bottom = self.stack.len();
                continue;
            }
            if self.test(leaves, any_hit) {
                return;
            }
            if group.1 <= 0x00ffffff {
                if self.instance != NONE && self.stack.len() == bottom {
                    self.instance = NONE;
                    bottom = 0;
                    self.ray = ray_space(origin, direction);
                }
                match self.stack.pop() {
                    Some(next) => group = next,
                    None => return,
                }
            }
        }
    }
}

/// The closest hit before `t_max`, or with `any_hit` the first one found.
pub fn traverse(scene: &Scene, origin: Vec3, direction: Vec3, t_max: f32, any_hit: bool, mask_seed: u32) -> Hit {
    let mut t = start(scene, [NONE; 2], [origin, direction], t_max, mask_seed);
    t.run(origin, direction, any_hit);
    t.hit
}

/// The closest hit of a ray that leaves the triangle `from[0]` of the instance `from[1]`, and does not meet it again.
pub fn traverse_from(scene: &Scene, from: [u32; 2], origin: Vec3, direction: Vec3, mask_seed: u32) -> Hit {
    let mut t = start(scene, from, [origin, direction], INFINITE_DISTANCE, mask_seed);
    t.run(origin, direction, false);
    t.hit
}

/// Share of light that is left of what comes along a shadow ray from `t_max`, by channel.
pub fn light_left(scene: &Scene, from: [u32; 2], origin: Vec3, direction: Vec3, t_max: f32, mask_seed: u32) -> Vec3 {
    let mut t = start(scene, from, [origin, direction], t_max, mask_seed);
    t.run(origin, direction, true);
    if t.hit.any() {
        return Vec3::ZERO;
    }
    Vec3::from(t.wall_depth.to_array().map(|d| if d == WALL_END { 0.0 } else { (-(d as f32) / WALL_HALVING).exp2() }))
}

fn start(scene: &Scene, from: [u32; 2], [origin, direction]: [Vec3; 2], t_max: f32, mask_seed: u32) -> Traversal<'_> {
    let hit = Hit { t: t_max, triangle: NONE, instance: NONE, barycentric: Vec2::ZERO };
    let (ray, stack) = (ray_space(origin, direction), Vec::with_capacity(STACK_SIZE));
    Traversal { scene, ray, stack, hit, instance: NONE, mask_seed, from, wall_depth: UVec3::ZERO }
}
