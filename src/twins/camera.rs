//! Twin of `glsl/shared/camera.glsl`.
use crate::layout::{Camera, Effects, FrameConstants, PIXEL_FILTER_GAUSSIAN, PIXEL_FILTER_POINT, PIXEL_FILTER_TENT};
use crate::math::hash::pcg;
use crate::math::warp::{warp_disk, warp_gaussian, warp_tent};
use crate::shaders::shared::camera::{PAIR_FILM, PAIR_LENS};
use crate::shaders::shared::lens::{BLURRED_RADIUS, SHARP_RADIUS};
use crate::shaders::shared::segment::{BY_CHANCE, MASK_HASH, MASK_INDEX};
use crate::twins::sampler::{Sampler, sample_2d};
use glam::{Vec2, Vec3, vec2};

/// A ray from the camera.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// Start in world units.
    pub origin: Vec3,
    /// Unit direction.
    pub direction: Vec3,
}

/// Film coordinates in pixels (x right, y down) to [-1, 1] (right, up).
pub fn film_from_pixel(pixel: Vec2, size: [u32; 2]) -> Vec2 {
    vec2(2.0, -2.0) * pixel / vec2(size[0] as f32, size[1] as f32) + vec2(-1.0, 1.0)
}

/// Film coordinates in pixels of a point in the scene, and its distance along the view direction, not above 0 for one that is not
/// in front of the camera. Twin of the function in `glsl/shared/surface_point.glsl`.
pub fn film_from_point(camera: &Camera, point: Vec3, size: [u32; 2]) -> Vec3 {
    let [forward, right, up] = [camera.forward, camera.right, camera.up].map(Vec3::from);
    let (off, across) = (point - Vec3::from(camera.position), right.cross(up));
    let det = forward.dot(across);
    let along = off.dot(across) / det;
    let film = vec2(off.dot(up.cross(forward)), off.dot(forward.cross(right))) / (det * along);
    ((film * vec2(0.5, -0.5) + 0.5) * vec2(size[0] as f32, size[1] as f32)).extend(along)
}

/// Width of a pixel in the middle of the film, at distance 1 or, where rays are parallel, at any.
pub fn pixel_width(camera: &Camera, size: [u32; 2]) -> f32 {
    let of = |edge: [f32; 3], pixels: u32| Vec3::from(edge).length() / pixels as f32;
    2.0 * of(camera.right, size[0]).max(of(camera.up, size[1]))
}

/// How far the lens blurs what lies at a distance along the view direction, from 0, sharp, to 1. Twin of the function in
/// `glsl/shared/lens.glsl`.
pub fn lens_blur(camera: &Camera, along: f32, size: [u32; 2]) -> f32 {
    let along = along.clamp(1e-18, 1e18);
    let scale = if camera.orthographic != 0 { along } else { 1.0 };
    let off = (1.0 / camera.focus_distance.max(1e-20) - 1.0 / along).abs() * scale;
    let radius = camera.lens_radius * off / pixel_width(camera, size);
    let t = ((radius - SHARP_RADIUS) / (BLURRED_RADIUS - SHARP_RADIUS)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// `lens` in [0, 1)^2 matters only to a lens of positive radius.
pub fn camera_ray(camera: &Camera, film: Vec2, lens: Vec2) -> Ray {
    let [forward, right, up] = [camera.forward, camera.right, camera.up].map(Vec3::from);
    let mut through = forward + film.x * right + film.y * up;
    let mut origin = Vec3::from(camera.position);
    if camera.orthographic != 0 {
        origin += film.x * right + film.y * up;
        through = forward;
    }
    if camera.lens_radius > 0.0 {
        let disk = camera.lens_radius * warp_disk(lens);
        let shift = disk.x * right.normalize() + disk.y * up.normalize();
        origin += shift;
        through -= shift / camera.focus_distance.max(1e-20);
    }
    let direction = through.normalize();
    Ray { origin: origin + camera.near * direction, direction }
}

/// Position on the film of a sample of `pixel`, in pixels.
pub fn film_sample(frame: &FrameConstants, effects: &Effects, pixel: u32, random: Sampler) -> Vec2 {
    let at = vec2((pixel % frame.path.size[0]) as f32, (pixel / frame.path.size[0]) as f32);
    let u = sample_2d(random, PAIR_FILM);
    at + match frame.path.pixel_filter {
        PIXEL_FILTER_TENT if effects.pixel_filter => 0.5 + vec2(warp_tent(u.x), warp_tent(u.y)),
        PIXEL_FILTER_GAUSSIAN if effects.pixel_filter => 0.5 + vec2(warp_gaussian(u.x), warp_gaussian(u.y)),
        PIXEL_FILTER_POINT if effects.pixel_filter => Vec2::splat(0.5),
        _ => u,
    }
}

/// The first ray of a sample's path, through `film` in pixels.
pub fn eye_ray(frame: &FrameConstants, effects: &Effects, film: Vec2, random: Sampler) -> Ray {
    let lens = if effects.lens { sample_2d(random, PAIR_LENS) } else { Vec2::ZERO };
    camera_ray(&frame.camera, film_from_pixel(film, frame.path.size), lens)
}

/// Seed of the alpha masks along a path.
pub fn path_seed(frame: &FrameConstants, effects: &Effects, pixel: u32, index: u32) -> u32 {
    let mut hash = pcg(pixel ^ pcg(!frame.path.seed));
    if index > 0xffff {
        hash = pcg(hash.wrapping_add(index >> 16)); // MASK_INDEX has room for so many
    }
    let order = if effects.independent_sampler { pcg(hash.wrapping_add(index)) } else { index.reverse_bits() };
    (order & MASK_INDEX) | (hash & MASK_HASH) | BY_CHANCE
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A film of 100 pixels that spans 2 at distance 1 and 8 at the focus, 4: a point at distance z spreads over .2 |4 - z| / z there, in
    /// pixels of .08. Where rays are parallel over a film of 2, over .2 |4 - z| / 4 in pixels of .02.
    #[test]
    fn a_lens_blurs_by_the_circle_of_confusion() {
        let lens = Camera {
            right: [1.0, 0.0, 0.0],
            up: [0.0, 1.0, 0.0],
            forward: [0.0, 0.0, -1.0],
            lens_radius: 0.2,
            focus_distance: 4.0,
            ..Default::default()
        };
        let smooth = |radius: f32| {
            let t = ((radius - 0.5) / 1.5).clamp(0.0, 1.0);
            t * t * (3.0 - 2.0 * t)
        };
        let parallel = Camera { orthographic: 1, ..lens };
        for along in [1.0f32, 2.0, 2.9, 3.0, 3.3, 4.0, 5.0, 6.0, 8.0, 1e30] {
            let expected = smooth(0.2 * (4.0 - along).abs() / along / 0.08);
            assert!((lens_blur(&lens, along, [100, 100]) - expected).abs() < 1e-4, "{along}: {expected}");
            let expected = smooth(0.2 * (4.0 - along).abs() / 4.0 / 0.02);
            assert!((lens_blur(&parallel, along, [100, 100]) - expected).abs() < 1e-4, "parallel, {along}: {expected}");
        }
        assert_eq!([0.0, 4.0, 1e30].map(|z| lens_blur(&Camera { lens_radius: 0.0, ..parallel }, z, [9, 9])), [0.0; 3]);
    }

    #[test]
    fn seeds_share_no_numbers_of_masks() {
        // Pixel and seed joined by exclusive-or alone, seeds 0 to 3 would have the same numbers at other pixels.
        let seeds = |seed: u32| {
            let frame = FrameConstants {
                path: crate::layout::PathConstants { seed, ..Default::default() },
                ..Default::default()
            };
            (0..4096u32).map(move |pixel| path_seed(&frame, &Effects::default(), pixel, 7)).collect::<Vec<_>>()
        };
        let first = seeds(0);
        for seed in 1..4 {
            let same = (0..4096).zip(seeds(seed)).filter(|(pixel, word)| first[pixel ^ seed as usize] == *word).count();
            assert!(same <= 4, "{same} of 4096"); // one in 16384 by chance
        }
        let all = |index: u32| -> Vec<u32> {
            (0..4096).map(|pixel| path_seed(&FrameConstants::default(), &Effects::default(), pixel, index)).collect()
        };
        let same = all(7).iter().zip(all(65_543)).filter(|(a, b)| *a == b).count();
        assert!(same <= 4, "{same} of 4096 beyond 65,536 samples");
    }
}
