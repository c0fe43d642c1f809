//! Positions and depths of surfaces, made of each other where a file has but one.
use super::vector;
use crate::image::aov::{Aov, Aovs};
use glam::Vec3;

/// Blender stores 1e10 where nothing is hit; in Tallow's own files such a distance is one.
const FARTHEST: f32 = 1e9;
/// Tangent of half the vertical field of view that is assumed where only depth is known: 40 degrees.
const HALF_VIEW: f32 = 0.364;

/// Which of the two a file has.
pub(super) enum Places {
    Both,
    Positions(Axis),
    Depths,
    Neither,
}

/// Depth along the mean normal. Visible surfaces face the camera, so that their mean normal points towards it, unless the image has
/// both of its sides alike or no normals; then all depths are 1. Hits are told from misses, which have no position, and lie 0.1 to 1.1
/// extents deep.
pub(super) struct Axis {
    normal: Vec3,
    nearest: f32,
    margin: f32,
}

impl Places {
    /// Says what has to be made up.
    pub(super) fn new(aovs: &Aovs, notes: &mut Vec<String>) -> Self {
        match (aovs.get(Aov::Position).is_some(), aovs.get(Aov::Depth).is_some()) {
            (true, true) => Self::Both,
            (true, false) => {
                let axis = Axis::new(aovs);
                let how = if axis.normal == Vec3::ZERO { "the same for all" } else { "along the mean normal" };
                notes.push(format!("depth: made of the position, {how}"));
                Self::Positions(axis)
            }
            (false, true) => {
                let how = "position: made of the depth, as if seen with a vertical field of view of 40 degrees";
                notes.push(how.to_owned());
                Self::Depths
            }
            (false, false) => Self::Neither,
        }
    }

    /// Position and depth of a pixel; depth is 0 where nothing is hit.
    pub(super) fn at(&self, aovs: &Aovs, i: usize) -> (Vec3, f32) {
        match self {
            Self::Both => (vector(aovs, Aov::Position, i), depth(aovs, i)),
            Self::Positions(axis) => {
                let position = vector(aovs, Aov::Position, i);
                (position, axis.depth(position))
            }
            Self::Depths => (seen(aovs, i, depth(aovs, i)), depth(aovs, i)),
            Self::Neither => (Vec3::ZERO, 0.0),
        }
    }
}

fn depth(aovs: &Aovs, i: usize) -> f32 {
    let farthest = if aovs.is_tallow_s() { f32::INFINITY } else { FARTHEST };
    Some(vector(aovs, Aov::Depth, i).x).filter(|&d| d > 0.0 && d < farthest).unwrap_or(0.0)
}

/// Where a ray through the pixel's centre ends, in camera space.
fn seen(aovs: &Aovs, i: usize, depth: f32) -> Vec3 {
    let (width, height) = (aovs.film.width as usize, aovs.film.height as f32);
    let (x, y) = ((i % width) as f32 + 0.5, (i / width) as f32 + 0.5);
    let step = 2.0 * HALF_VIEW / height;
    depth * Vec3::new((x - 0.5 * width as f32) * step, (0.5 * height - y) * step, -1.0).normalize()
}

impl Axis {
    fn new(aovs: &Aovs) -> Self {
        let pixels = 0..aovs.film.pixels();
        let normals = pixels.clone().map(|i| vector(aovs, Aov::Normal, i).normalize_or_zero());
        let normal = normals.sum::<Vec3>().normalize_or_zero();
        let hits = pixels.map(|i| vector(aovs, Aov::Position, i)).filter(|p| *p != Vec3::ZERO).map(|p| -p.dot(normal));
        let (nearest, farthest) = hits.fold((f32::INFINITY, f32::NEG_INFINITY), |(a, b), d| (a.min(d), b.max(d)));
        let margin = if farthest > nearest { 0.1 * (farthest - nearest) } else { 1.0 };
        Self { normal, nearest, margin }
    }

    fn depth(&self, position: Vec3) -> f32 {
        if position != Vec3::ZERO { -position.dot(self.normal) - self.nearest + self.margin } else { 0.0 }
    }
}
