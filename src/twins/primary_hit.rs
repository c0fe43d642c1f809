//! Twin of `glsl/trace/primary_hit.comp` and of `glsl/shared/first_hit.glsl`.
use crate::layout::{Camera, FrameConstants, Guide, NONE, SurfacePoint};
use crate::math::hash::unit_interval;
use crate::scene::Scene;
use crate::shaders::primary_hit::LENS_RAYS;
use crate::shaders::shared::segment::STRONGER_WAY;
use crate::twins::bsdf::{bsdf_albedo, bsdf_is_delta, bsdf_sample, bsdf_share, seen_albedo};
use crate::twins::camera::{Ray, camera_ray, film_from_pixel, lens_blur};
use crate::twins::light::INFINITE_DISTANCE;
use crate::twins::surface::{View, facing_of, light_share, side_of, surface_at, surface_bsdf, view_of};
use crate::twins::texture::mask_seed;
use crate::twins::traverse::{Hit, traverse};
use glam::{Vec2, Vec3, vec2};

/// The primary hit through the centre of `pixel` (row-major), from the middle of the lens.
pub fn guide(scene: &Scene, frame: &FrameConstants, pixel: u32) -> Guide {
    let ray = centre_ray(frame, pixel);
    first_hit(scene, frame, &ray, STRONGER_WAY).guide
}

/// What the ray through the centre of `pixel` shows: that hit or, where it is smooth, what is seen in it.
pub fn seen(scene: &Scene, frame: &FrameConstants, pixel: u32) -> Guide {
    let ray = centre_ray(frame, pixel);
    seen_hit(scene, frame, &ray, STRONGER_WAY).guide
}

/// The mean of what rays through the lens show at the centre of `pixel`, and how far the lens blurs it.
pub fn through_lens(scene: &Scene, frame: &FrameConstants, pixel: u32) -> (Guide, f32) {
    let film = film_from_pixel(centre_of(frame, pixel), frame.path.size);
    let (mut sum, mut hits, mut blur) = ([Vec3::ZERO; 3], 0.0, 0.0);
    let mut depths = 0.0;
    for k in 0..LENS_RAYS {
        let point = vec2((k as f32 + 0.5) / LENS_RAYS as f32, unit_interval(k.reverse_bits()));
        let ray = camera_ray(&frame.camera, film, point);
        let Guide { normal, position, albedo, depth, .. } = seen_hit(scene, frame, &ray, STRONGER_WAY).guide;
        let distance = if depth > 0.0 { depth } else { INFINITE_DISTANCE };
        blur += lens_blur(&frame.camera, distance * ray.direction.dot(frame.camera.forward.into()), frame.path.size);
        if depth > 0.0 {
            hits += 1.0;
            depths += depth;
            sum = std::array::from_fn(|i| sum[i] + Vec3::from([normal, position, albedo][i]));
        }
    }
    let [normal, position, albedo] = sum;
    let rays = LENS_RAYS as f32;
    let guide = Guide {
        normal: normal.normalize_or_zero().into(),
        depth: depths / rays,
        position: (position / f32::max(hits, 1.0)).into(),
        object: if hits > 0.0 { 0 } else { NONE },
        albedo: (albedo / rays).into(),
        material: if blur > 0.0 { NONE } else { 0 },
        ..Default::default()
    };
    (guide, blur / rays)
}

/// The point of that hit.
pub fn point(scene: &Scene, frame: &FrameConstants, pixel: u32) -> SurfacePoint {
    let ray = centre_ray(frame, pixel);
    let hit = traverse(scene, ray.origin, ray.direction, INFINITE_DISTANCE, false, STRONGER_WAY);
    let weights = hit.barycentric.into();
    SurfacePoint { triangle: hit.triangle, instance: hit.instance, weights, ..Default::default() }
}

fn centre_ray(frame: &FrameConstants, pixel: u32) -> Ray {
    let camera = Camera { lens_radius: 0.0, ..frame.camera };
    camera_ray(&camera, film_from_pixel(centre_of(frame, pixel), frame.path.size), Vec2::splat(0.5))
}

fn centre_of(frame: &FrameConstants, pixel: u32) -> Vec2 {
    vec2((pixel % frame.path.size[0]) as f32, (pixel / frame.path.size[0]) as f32) + 0.5
}

/// What a ray meets first.
struct FirstHit {
    /// As the kernel writes it.
    guide: Guide,
    hit: Hit,
}

fn first_hit(scene: &Scene, frame: &FrameConstants, ray: &Ray, mask_seed: u32) -> FirstHit {
    let hit = traverse(scene, ray.origin, ray.direction, INFINITE_DISTANCE, false, mask_seed);
    if !hit.any() {
        return FirstHit { guide: Guide { object: NONE, material: NONE, ..Guide::default() }, hit };
    }
    let s = surface_at(scene, &hit);
    let bsdf = surface_bsdf(scene, &s);
    let normal = side_of(&s, -ray.direction) * s.normal;
    let guide = Guide {
        normal: normal.into(),
        depth: hit.t + frame.camera.near,
        position: s.position.into(),
        object: s.object,
        albedo: bsdf_albedo(&bsdf, -s.normal.dot(ray.direction)).into(),
        material: s.material,
        ..Default::default()
    };
    FirstHit { guide, hit }
}

/// What a primary ray shows.
pub struct SeenHit {
    /// As the kernel writes it.
    pub guide: Guide,
    /// The albedo that a path keeps which begins like this.
    pub kept: Vec3,
}

/// A ray on its way through smooth surfaces.
struct Sight {
    way: Ray,
    throughput: Vec3,
    albedo: Vec3,
    /// Probability that a path goes this way.
    share: f32,
}

impl Sight {
    /// Takes the albedo of the surface that is hit, and goes on from a smooth one by the stronger way. False where none goes on.
    fn look_on(&mut self, scene: &Scene, hit: &Hit) -> bool {
        let s = surface_at(scene, hit);
        let mut bsdf = surface_bsdf(scene, &s);
        let facing = facing_of(&s, &bsdf, -self.way.direction);
        let View { facing, basis, wo } = view_of(&s, &mut bsdf, facing, -self.way.direction);
        let smooth_here = bsdf_is_delta(&bsdf);
        self.albedo = seen_albedo(self.throughput, bsdf_albedo(&bsdf, wo.z), self.share);
        if !smooth_here {
            return false;
        }
        let (sampled, next) = bsdf_sample(&bsdf, wo, 0.5, Vec2::splat(0.5));
        let direction = basis * next.wi;
        self.way = Ray { origin: s.ray_origin(direction), direction };
        self.throughput *= next.weight * light_share(&s, &facing, direction, next.wi.z);
        self.share *= bsdf_share(&bsdf, wo, 0.5);
        if self.share < 1.0 {
            self.albedo = seen_albedo(self.throughput, Vec3::ONE, 1.0);
        }
        sampled && self.throughput.max_element() > 0.0
    }
}

/// What a primary ray shows, behind smooth surfaces.
pub fn seen_hit(scene: &Scene, frame: &FrameConstants, ray: &Ray, seed: u32) -> SeenHit {
    let FirstHit { mut guide, mut hit } = first_hit(scene, frame, ray, mask_seed(seed, 0));
    let (object, material) = (guide.object, guide.material);
    let way = Ray { origin: ray.origin, direction: ray.direction };
    let mut sight = Sight { way, throughput: Vec3::ONE, albedo: Vec3::ZERO, share: 1.0 };
    let mut length = 0.0;
    for bounce in 1..frame.path.max_depth {
        if !hit.any() || !sight.look_on(scene, &hit) {
            break;
        }
        length += hit.t;
        FirstHit { guide, hit } = first_hit(scene, frame, &sight.way, mask_seed(seed, 2 * bounce));
        let (sky, behind) = (!hit.any(), if hit.any() { hit.t } else { 0.0 });
        if sky {
            guide = Guide { normal: (-sight.way.direction).into(), object, material, ..guide };
        }
        guide.depth = length + behind + frame.camera.near;
        guide.position = (ray.origin + (length + behind) * ray.direction).into();
        guide.albedo = (sight.throughput * if sky { Vec3::ONE } else { Vec3::from(guide.albedo) }).into();
    }
    SeenHit { guide, kept: sight.albedo }
}
