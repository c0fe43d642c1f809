//! Twin of `glsl/shared/scene.glsl`: typed access to the scene's arrays.
use crate::layout::{Instance, NONE};
use crate::scene::Scene;
use crate::scene::lookup::triangle_coordinates;
use crate::twins::sphere::Sphere;
use glam::{Mat3, Vec2, Vec3, Vec4, vec3};

/// Three rows that take a point (x, y, z, 1), as GLSL's mat4x3 does.
#[derive(Clone, Copy, Debug)]
pub struct Rows([Vec4; 3]);

impl Rows {
    /// Transforms a point.
    pub fn point(&self, p: Vec3) -> Vec3 {
        let row = |r: Vec4| r.x * p.x + r.y * p.y + r.z * p.z + r.w;
        vec3(row(self.0[0]), row(self.0[1]), row(self.0[2]))
    }

    /// Transforms a direction.
    pub fn vector(&self, v: Vec3) -> Vec3 {
        let row = |r: Vec4| r.x * v.x + r.y * v.y + r.z * v.z;
        vec3(row(self.0[0]), row(self.0[1]), row(self.0[2]))
    }

    /// The sum of the magnitudes that are added up for a point of coordinates up to `p`.
    pub fn magnitude(&self, p: Vec3) -> Vec3 {
        Vec3::from(self.0.map(|r| r.x.abs() * p.x + r.y.abs() * p.y + r.z.abs() * p.z + r.w.abs()))
    }

    /// The transpose of the linear part: of a normal, when `self` leads the other way.
    pub fn normal(&self, n: Vec3) -> Vec3 {
        Mat3::from_cols(self.0[0].truncate(), self.0[1].truncate(), self.0[2].truncate()) * n
    }
}

/// Transform from object to world space.
pub fn world_from_object(i: &Instance) -> Rows {
    Rows([i.world0.into(), i.world1.into(), i.world2.into()])
}

/// Transform from world to object space.
pub fn object_from_world(i: &Instance) -> Rows {
    Rows([i.object0.into(), i.object1.into(), i.object2.into()])
}

/// Corners of a triangle in object space (world space without instances).
pub fn triangle_vertices(scene: &Scene, triangle: u32) -> [Vec3; 3] {
    let t = &scene.triangles[triangle as usize];
    [t.v0.into(), t.v1.into(), t.v2.into()]
}

/// Material of a triangle, which its instance may replace.
pub fn material_of(scene: &Scene, triangle: u32, instance: u32) -> u32 {
    let material = scene.triangles[triangle as usize].material;
    match instance {
        NONE => material,
        i => Some(scene.instances[i as usize].material).filter(|&m| m != NONE).unwrap_or(material),
    }
}

/// Coordinates at which a point reads a picture; `barycentric` weighs vertices 1 and 2.
pub fn texture_coordinates(scene: &Scene, image: u32, triangle: u32, barycentric: Vec2) -> Vec2 {
    if let Some(sphere) = Sphere::of(scene, triangle) {
        return sphere.coordinates_of_hit(barycentric);
    }
    triangle_coordinates(scene, image, triangle, barycentric)
}
