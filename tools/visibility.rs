//! Renders the average visibility of Nori's first assignment: the share of the hemisphere, with all directions weighted
//! alike, in which nothing lies within a given distance of the first hit. This is not light transport, so no kernel
//! computes it; the CPU twins of the kernels do.
use glam::vec2;
use rayon::prelude::*;
use std::path::Path;
use tallow::image::Picture;
use tallow::layout::{Camera, NONE};
use tallow::math::warp::warp_sphere;
use tallow::scene::Scene;
use tallow::twins::camera::{camera_ray, film_from_pixel};
use tallow::twins::sampler::{sample_2d, sampler_start};
use tallow::twins::surface::surface_at;
use tallow::twins::traverse::{light_left, traverse_from};

/// Renders the scene's film with `spp` samples per pixel. `reach` is the distance in world units.
///
/// # Errors
/// When the scene cannot be loaded.
pub fn render(scene: &Path, spp: u32, reach: f32) -> anyhow::Result<Picture> {
    let scene = Scene::load(scene)?;
    let (width, height) = (scene.settings.width, scene.settings.height);
    let camera = scene.camera([width, height])?;
    let mean = |pixel: u32| {
        (0..spp).map(|i| sample(&scene, &camera, [width, height], pixel, i, reach)).sum::<f32>() / spp as f32
    };
    let pixels = (0..width * height).into_par_iter().map(|pixel| [mean(pixel); 3]).collect();
    Ok(Picture { width, height, pixels })
}

/// One sample: 1 if nothing is hit, which as in Nori includes rays that leave the scene, else 0.
fn sample(scene: &Scene, camera: &Camera, size: [u32; 2], pixel: u32, index: u32, reach: f32) -> f32 {
    let random = sampler_start(pixel, index, 0, false);
    let at = vec2((pixel % size[0]) as f32, (pixel / size[0]) as f32) + sample_2d(random, 0);
    let ray = camera_ray(camera, film_from_pixel(at, size), vec2(0.5, 0.5));
    let hit = traverse_from(scene, [NONE; 2], ray.origin, ray.direction, 0);
    if !hit.any() {
        return 1.0;
    }
    let s = surface_at(scene, &hit);
    let normal = if s.geometric.dot(ray.direction) > 0.0 { -s.geometric } else { s.geometric };
    let sphere = warp_sphere(sample_2d(random, 1));
    let direction = if sphere.dot(normal) < 0.0 { -sphere } else { sphere };
    light_left(scene, [hit.triangle, hit.instance], s.ray_origin(normal), direction, reach, 0).x
}
