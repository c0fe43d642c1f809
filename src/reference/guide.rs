//! Twin of `glsl/guide.comp`.
use crate::gpu::layout::{Camera, Guide, NONE, PathPush};
use crate::reference::bsdf::bsdf_albedo;
use crate::reference::camera::{camera_ray, film_from_pixel};
use crate::reference::light::INFINITE_DISTANCE;
use crate::reference::sampler::pcg;
use crate::reference::surface::{surface_at, surface_bsdf};
use crate::reference::traverse::traverse;
use crate::scene::Scene;
use glam::{Vec2, vec2};

/// The primary hit through the centre of `pixel` (row-major), from the middle of the lens.
pub fn guide(scene: &Scene, push: &PathPush, pixel: u32) -> Guide {
    let centre = vec2((pixel % push.size[0]) as f32, (pixel / push.size[0]) as f32) + 0.5;
    let camera = Camera { lens_radius: 0.0, ..push.camera };
    let ray = camera_ray(&camera, film_from_pixel(centre, push.size), Vec2::splat(0.5));
    let hit = traverse(scene, ray.origin, ray.direction, INFINITE_DISTANCE, false, pcg(pixel));
    if !hit.any() {
        return Guide { object: NONE, material: NONE, ..Guide::default() };
    }
    let s = surface_at(scene, &hit);
    let normal = if s.normal.dot(ray.direction) > 0.0 { -s.normal } else { s.normal };
    Guide {
        normal: normal.into(),
        depth: hit.t + camera.near,
        position: s.position.into(),
        object: s.object,
        albedo: bsdf_albedo(&surface_bsdf(scene, &s)).into(),
        material: s.material,
    }
}
