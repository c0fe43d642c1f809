//! Normal maps whose coordinates are turned, scaled and mirrored.
use crate::kernels::{check, run, small};
use crate::materials::{one, patch, surface, texture};
use crate::support::{assert_silent, gpu};
use tallow::render::{Outputs, called_for};
use tallow::scene::Loaded;
use tallow::scene::description::*;

/// Turns in degrees, and scales.
const TRANSFORMS: [(f32, [f32; 2]); 4] = [(90.0, [1.0; 2]), (30.0, [2.0, 0.5]), (0.0, [-2.0, 1.0]), (0.0, [1.0, -1.0])];

fn material(rotate: f32, scale: [f32; 2]) -> MaterialTable {
    let map = || Some(TextureTable { rotate, scale, ..texture("bumps").unwrap() });
    MaterialTable {
        name: "m".into(),
        kind: MaterialType::MetallicRoughness,
        normal_map: map(),
        clearcoat: Some(1.0),
        clearcoat_normal_map: map(),
        ..MaterialTable::default()
    }
}

/// Coordinates as KHR_texture_transform has them, whose v points down.
fn transformed([u, v]: [f32; 2], rotate: f32, [fx, fy]: [f32; 2]) -> [f32; 2] {
    let ((s, c), x, y) = (rotate.to_radians().sin_cos(), fx * u, fy * (1.0 - v));
    [c * x + s * y, 1.0 - (c * y - s * x)]
}

#[test]
fn relief_follows_the_picture() {
    let mesh = || Mesh { tangents: Vec::new(), ..patch() };
    for (rotate, scale) in TRANSFORMS {
        let mut moved = mesh();
        moved.uvs.iter_mut().for_each(|uv| *uv = transformed(*uv, rotate, scale));
        let by_map = one(material(rotate, scale), mesh(), Transform::default(), false);
        let by_mesh = one(material(0.0, [1.0; 2]), moved, Transform::default(), false);
        for (x, y) in [(0.3, -0.4), (-0.7, 0.1)] {
            let [a, b] = [&by_map, &by_mesh].map(|scene| surface(scene, x, y));
            let apart = [a.normal - b.normal, a.coat_normal - b.coat_normal].map(|d| d.length());
            assert!(apart[0] < 1e-3 && apart[1] < 1e-3, "{rotate} {scale:?} at {x}, {y}: {apart:?}");
            assert!((a.normal - a.smooth_normal).length() > 0.01, "control: a map that does nothing");
        }
    }
}

#[test]
fn kernels_agree_about_relief_that_is_turned() {
    let gpu = gpu();
    let mesh = Mesh { tangents: Vec::new(), ..patch() };
    let mut loaded =
        Loaded { scene: one(material(30.0, [-2.0, 0.5]), mesh, Transform::default(), false), ..Loaded::default() };
    small(&mut loaded.settings);
    let effects = called_for(&loaded, &loaded.settings, Outputs::FILTERED);
    check("turned relief", &run(&gpu, &loaded, effects));
    assert_silent(&gpu);
}
