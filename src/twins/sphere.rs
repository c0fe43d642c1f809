//! Twin of `glsl/shared/sphere.glsl`.
use crate::layout::{SPHERE, SPHERE_INWARD, SPHERE_MIRRORED};
use crate::math::octahedral::octahedral_vector;
use crate::scene::Scene;
use glam::{Vec2, Vec3, vec2};
use std::f32::consts::PI;

/// A sphere in place of a triangle.
#[derive(Clone, Copy, Debug)]
pub struct Sphere {
    /// Centre in the space of its mesh.
    pub centre: Vec3,
    /// Vector from the centre to v = 1.
    pub pole: Vec3,
    /// Vector from the centre to u = 0 on the equator.
    pub meridian: Vec3,
    flags: u32,
}

impl Sphere {
    /// The sphere in place of this triangle; `None` for a triangle.
    pub fn of(scene: &Scene, triangle: u32) -> Option<Self> {
        let t = &scene.triangles[triangle as usize];
        let sphere = Self { centre: t.v0.into(), pole: t.v1.into(), meridian: t.v2.into(), flags: t.primitive };
        (t.primitive & SPHERE != 0).then_some(sphere)
    }

    /// Whether the front side is the inner one.
    pub fn inward(&self) -> bool {
        self.flags & SPHERE_INWARD != 0
    }

    /// Vector from the centre to the equator a quarter turn of azimuth from `meridian`, as long as the radius.
    pub fn side(&self) -> Vec3 {
        let side = self.pole.cross(self.meridian) / self.pole.length();
        if self.flags & SPHERE_MIRRORED != 0 { -side } else { side }
    }

    /// Texture coordinates of the point in the direction `normal`.
    pub fn coordinates(&self, normal: Vec3) -> Vec2 {
        let (x, y) = (normal.dot(self.meridian), normal.dot(self.side()));
        let u = if x != 0.0 || y != 0.0 { y.atan2(x) * (0.5 / PI) } else { 0.0 };
        let v = 1.0 - vec2(x, y).length().atan2(normal.dot(self.pole)) / PI;
        vec2(if u < 0.0 { u + 1.0 } else { u }, v)
    }

    /// Texture coordinates of a hit's octahedral point.
    pub fn coordinates_of_hit(&self, point: Vec2) -> Vec2 {
        self.coordinates(octahedral_vector(point))
    }
}
