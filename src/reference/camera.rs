//! Twin of `glsl/shared/camera.glsl`.
use crate::gpu::layout::Camera;
use crate::reference::warp::warp_disk;
use glam::{Vec2, Vec3, vec2};

/// A ray.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// World units.
    pub origin: Vec3,
    /// Unit.
    pub direction: Vec3,
}

/// Film coordinates in pixels (x right, y down) to [-1, 1] (right, up).
pub fn film_from_pixel(pixel: Vec2, size: [u32; 2]) -> Vec2 {
    vec2(2.0, -2.0) * pixel / vec2(size[0] as f32, size[1] as f32) + vec2(-1.0, 1.0)
}

/// `lens` in [0, 1)^2 matters only to a lens of positive radius.
pub fn camera_ray(camera: &Camera, film: Vec2, lens: Vec2) -> Ray {
    let [forward, right, up] = [camera.forward, camera.right, camera.up].map(Vec3::from);
    let mut through = forward + film.x * right + film.y * up;
    let mut origin = Vec3::from(camera.position);
    if camera.lens_radius > 0.0 {
        let disk = camera.lens_radius * warp_disk(lens);
        let shift = disk.x * right.normalize() + disk.y * up.normalize();
        origin += shift;
        through -= shift / camera.focus_distance.max(1e-20);
    }
    let direction = through.normalize();
    Ray { origin: origin + camera.near * direction, direction }
}
