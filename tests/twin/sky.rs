//! Tests in which directions the texels of a sky lie, worked out by hand, on the CPU twin and in pictures.
use crate::support::{assert_silent, gpu, render};
use crate::twin::Workplace;
use glam::{Vec3, vec3};
use std::f32::consts::FRAC_1_SQRT_2;
use tallow::render::{Outputs, Renderer};
use tallow::scene::Loaded;
use tallow::twins::light::environment_radiance;

/// Of a sky of 4 x 2 texels: the radiance of one and the direction of its centre, which lies 45 degrees above or below
/// the horizon and half a right angle from the axes. Row 0 is up, column 0 begins at -z, and columns go on towards +x.
const TEXELS: [(f32, Vec3); 4] = [
    (1.0, vec3(0.5, FRAC_1_SQRT_2, -0.5)),
    (6.0, vec3(0.5, -FRAC_1_SQRT_2, 0.5)),
    (3.0, vec3(-0.5, FRAC_1_SQRT_2, 0.5)),
    (8.0, vec3(-0.5, -FRAC_1_SQRT_2, -0.5)),
];

/// Turns in degrees, counter-clockwise seen from above, so that 90 take +x to -z; with their sines and cosines.
const TURNS: [(f32, [f32; 2]); 3] = [(0.0, [0.0, 1.0]), (90.0, [1.0, 0.0]), (45.0, [FRAC_1_SQRT_2; 2])];

/// Seen by a camera of one pixel that looks along a direction.
fn sky(turn: f32, direction: Vec3) -> Loaded {
    let [x, y, z] = direction.to_array();
    let place = Workplace::new().sky("sky.exr", 4, 2, |x, y| (1 + x + 4 * y) as f32);
    place.scene(&format!(
        "[film]\nwidth = 1\nheight = 1\nfilter = 'point'\n[render]\nspp = 1\nmax_depth = 1\n\
         [camera]\nposition = [0.0, 0.0, 0.0]\ntarget = [{x:?}, {y:?}, {z:?}]\n\
         [environment]\nfile = 'sky.exr'\nrotation = {turn:?}\n"
    ))
}

#[test]
fn texels_lie_where_they_are_said_to() {
    let gpu = gpu();
    let mut wrong = Vec::new();
    for (turn, [sine, cosine]) in TURNS {
        for (radiance, direction) in TEXELS {
            let Vec3 { x, y, z } = direction;
            let turned = vec3(cosine * x + sine * z, y, cosine * z - sine * x);
            let scene = sky(turn, turned);
            let (twin, _) = environment_radiance(&scene, &scene.lights[0], turned);
            let renderer = Renderer::new(&gpu, &scene, &scene.settings, Outputs::default()).unwrap();
            let found = [twin.x, render(&gpu, &renderer)[0].mean[0]];
            if found.iter().any(|v| (v - radiance).abs() > 1e-2) {
                wrong.push((turn, direction, radiance, found));
            }
        }
    }
    assert!(wrong.is_empty(), "turn, direction in the sky, radiance, that of twin and kernel: {wrong:#?}");
    assert_silent(&gpu);
}
