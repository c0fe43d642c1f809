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

/// Which set of coordinates the map of the surface reads, and which that of its clear coat.
fn of_sets(own: u32, coat: u32) -> MaterialTable {
    let table = |uv| Some(TextureTable { uv, ..texture("bumps").unwrap() });
    MaterialTable { normal_map: table(own), clearcoat_normal_map: table(coat), ..material(0.0, [1.0; 2]) }
}

#[test]
fn each_relief_lies_as_its_own_coordinates_do() {
    let mesh = || Mesh { tangents: Vec::new(), ..patch() };
    let swapped = || Mesh { uvs: mesh().uvs2, uvs2: mesh().uvs, ..mesh() };
    let scene = |material, mesh| one(material, mesh, Transform::default(), false);
    for (own, coat) in [(0, 1), (1, 0)] {
        let apart = scene(of_sets(own, coat), mesh());
        for (x, y) in [(0.3, -0.4), (-0.7, 0.1)] {
            let both = surface(&apart, x, y);
            let alone = |uv| surface(&scene(of_sets(0, 0), if uv == 0 { mesh() } else { swapped() }), x, y);
            let normals = [(both.normal, alone(own).normal), (both.coat_normal, alone(coat).coat_normal)];
            for (got, want) in normals {
                assert!((got - want).length() < 1e-6, "sets {own} and {coat} at {x}, {y}: {got}, not {want}");
            }
        }
    }
}

#[test]
fn kernels_agree_about_relief_that_is_turned_and_of_two_sets() {
    let gpu = gpu();
    for (what, material) in [("turned relief", material(30.0, [-2.0, 0.5])), ("relief of two sets", of_sets(0, 1))] {
        let mesh = Mesh { tangents: Vec::new(), ..patch() };
        let mut loaded = Loaded { scene: one(material, mesh, Transform::default(), false), ..Loaded::default() };
        small(&mut loaded.settings);
        let effects = called_for(&loaded, &loaded.settings, Outputs::FILTERED);
        check(what, &run(&gpu, &loaded, effects));
    }
    assert_silent(&gpu);
}
