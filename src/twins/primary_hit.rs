//! Twin of `glsl/trace/primary_hit.comp` and of `glsl/shared/first_hit.glsl`.
use crate::layout::{Camera, FrameConstants, Guide, NONE, SurfacePoint};
use crate::math::hash::pcg;
use crate::scene::Scene;
use crate::twins::bsdf::{bsdf_albedo, bsdf_is_delta};
use crate::twins::camera::{Ray, camera_ray, film_from_pixel};
use crate::twins::light::INFINITE_DISTANCE;
use crate::twins::surface::{side_of, surface_at, surface_bsdf};
use crate::twins::traverse::traverse;
use glam::{Vec2, vec2};

/// The primary hit through the centre of `pixel` (row-major), from the middle of the lens.
pub fn guide(scene: &Scene, frame: &FrameConstants, pixel: u32) -> Guide {
    let ray = centre_ray(frame, pixel);
    first_hit(scene, frame, ray, pcg(pixel)).0
}

/// The point of that hit.
pub fn point(scene: &Scene, frame: &FrameConstants, pixel: u32) -> SurfacePoint {
    let ray = centre_ray(frame, pixel);
    let hit = traverse(scene, ray.origin, ray.direction, INFINITE_DISTANCE, false, pcg(pixel));
    let weights = hit.barycentric.into();
    SurfacePoint { triangle: hit.triangle, instance: hit.instance, weights, ..Default::default() }
}

fn centre_ray(frame: &FrameConstants, pixel: u32) -> Ray {
    let centre = vec2((pixel % frame.path.size[0]) as f32, (pixel / frame.path.size[0]) as f32) + 0.5;
    let camera = Camera { lens_radius: 0.0, ..frame.camera };
    camera_ray(&camera, film_from_pixel(centre, frame.path.size), Vec2::splat(0.5))
}

/// What a primary ray meets, and whether that is a smooth surface, all of whose light counts as direct.
pub fn first_hit(scene: &Scene, frame: &FrameConstants, ray: Ray, mask_seed: u32) -> (Guide, bool) {
    let hit = traverse(scene, ray.origin, ray.direction, INFINITE_DISTANCE, false, mask_seed);
    if !hit.any() {
        return (Guide { object: NONE, material: NONE, ..Guide::default() }, false);
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
    (guide, bsdf_is_delta(&bsdf))
}
