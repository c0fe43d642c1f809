//! The guides of a filter, from whatever an image tells of its surfaces.
use crate::image::aov::{Aov, Aovs};
use crate::layout::{Guide, NONE, vec3};
use glam::Vec3;

/// Blender stores 1e10 where nothing is hit.
const FARTHEST: f32 = 1e9;
/// Tangent of half the vertical field of view that is assumed where only depth is known: 40 degrees.
const HALF_VIEW: f32 = 0.364;

/// One guide per pixel, zero where nothing is known; says what had to be made up.
pub(super) fn guides(aovs: &Aovs, notes: &mut Vec<String>) -> Vec<Guide> {
    let pixels = aovs.film.pixels();
    let normals: Vec<Vec3> = (0..pixels).map(|i| normal(aovs, i)).collect();
    let (positions, depths) = places(aovs, &normals, notes);
    let guide = |i: usize| {
        let hit = aovs.holds(i) && depths[i] > 0.0;
        Guide {
            normal: normals[i].into(),
            depth: depths[i],
            position: positions[i].into(),
            object: if hit || normals[i] != Vec3::ZERO { 0 } else { NONE },
            albedo: vector(aovs, Aov::Albedo, i).into(),
            material: NONE,
            ..Default::default()
        }
    };
    (0..pixels).map(guide).collect()
}

/// 0 where there is none, or what there is is no number.
fn vector(aovs: &Aovs, aov: Aov, i: usize) -> Vec3 {
    let v: vec3 = aovs.get(aov).map_or([0.0; 3], |plane| plane[i]);
    Some(Vec3::from(v)).filter(|v| v.is_finite()).unwrap_or_default()
}

/// Means over a pixel's samples are shorter than 1.
fn normal(aovs: &Aovs, i: usize) -> Vec3 {
    vector(aovs, Aov::Normal, i).normalize_or_zero()
}

/// Position and depth of every pixel; depth is 0 where nothing is hit.
fn places(aovs: &Aovs, normals: &[Vec3], notes: &mut Vec<String>) -> (Vec<Vec3>, Vec<f32>) {
    let pixels = normals.len();
    let position = |i| vector(aovs, Aov::Position, i);
    let depth = |i| Some(vector(aovs, Aov::Depth, i).x).filter(|&d| d > 0.0 && d < FARTHEST).unwrap_or(0.0);
    match (aovs.get(Aov::Position).is_some(), aovs.get(Aov::Depth).is_some()) {
        (true, true) => ((0..pixels).map(position).collect(), (0..pixels).map(depth).collect()),
        (true, false) => {
            notes.push("depth: made of the position, along the mean normal".to_owned());
            let positions: Vec<Vec3> = (0..pixels).map(position).collect();
            let depths = along_mean_normal(&positions, normals);
            (positions, depths)
        }
        (false, true) => {
            notes
                .push("position: made of the depth, as if seen with a vertical field of view of 40 degrees".to_owned());
            let depths: Vec<f32> = (0..pixels).map(depth).collect();
            ((0..pixels).map(|i| seen(aovs, i, depths[i])).collect(), depths)
        }
        (false, false) => (vec![Vec3::ZERO; pixels], vec![0.0; pixels]),
    }
}

/// Where a ray through the pixel's centre ends, in camera space.
fn seen(aovs: &Aovs, i: usize, depth: f32) -> Vec3 {
    let (width, height) = (aovs.film.width as usize, aovs.film.height as f32);
    let (x, y) = ((i % width) as f32 + 0.5, (i / width) as f32 + 0.5);
    let step = 2.0 * HALF_VIEW / height;
    depth * Vec3::new((x - 0.5 * width as f32) * step, (0.5 * height - y) * step, -1.0).normalize()
}

/// Visible surfaces face the camera, so that their mean normal points towards it, unless the image has both of its sides
/// alike; then there is no depth. Hits are told from misses, which have no position, and lie 0.1 to 1.1 extents deep.
fn along_mean_normal(positions: &[Vec3], normals: &[Vec3]) -> Vec<f32> {
    let axis = normals.iter().sum::<Vec3>().normalize_or_zero();
    let along = |p: &Vec3| -p.dot(axis);
    let hits = || positions.iter().filter(|p| **p != Vec3::ZERO).map(along);
    let (nearest, farthest) = hits().fold((f32::INFINITY, f32::NEG_INFINITY), |(a, b), d| (a.min(d), b.max(d)));
    let margin = 0.1 * (farthest - nearest);
    let depth = |p: &Vec3| if *p == Vec3::ZERO || axis == Vec3::ZERO { 0.0 } else { along(p) - nearest + margin };
    positions.iter().map(depth).collect()
}
