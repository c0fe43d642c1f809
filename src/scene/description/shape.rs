//! Shapes that need no file, with the extents, normals and texture coordinates of Mitsuba's shapes of the same name.
use super::mesh::Mesh;
use serde::Deserialize;
use std::f32::consts::{PI, TAU};

/// A shape in its own space.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Shape {
    /// Unit sphere around the origin, its poles on z; tessellated where it cannot stay exact (`build/plan.rs`).
    Sphere,
    /// [-1, 1] x [-1, 1] in the plane z = 0, normal +z.
    Rectangle,
    /// [-1, 1] in x, y and z, normals outward.
    Cube,
    /// Unit disk in the plane z = 0, normal +z, tessellated.
    Disk,
}

impl Shape {
    /// How many triangles [`Self::mesh`] returns.
    pub(in crate::scene) fn triangles(self, segments: u32) -> u64 {
        let n = u64::from(segments);
        match self {
            Self::Sphere => 2 * n * (n.div_ceil(2).max(2) - 1),
            Self::Rectangle => 2,
            Self::Cube => 12,
            Self::Disk => n,
        }
    }

    /// Triangles of the shape; `segments` around, at least 3 (sphere: half as many from pole to pole).
    pub(in crate::scene) fn mesh(self, segments: u32) -> Mesh {
        match self {
            Self::Sphere => sphere(segments),
            Self::Rectangle => rectangle(),
            Self::Cube => cube(),
            Self::Disk => disk(segments),
        }
    }
}

fn push(mesh: &mut Mesh, p: [f32; 3], n: [f32; 3], uv: [f32; 2]) {
    mesh.positions.push(p);
    mesh.normals.push(n);
    mesh.uvs.push(uv);
}

/// Rows run from +z to -z; v falls from 1 at the north pole.
fn sphere(segments: u32) -> Mesh {
    let (mut mesh, rows) = (Mesh::default(), segments.div_ceil(2).max(2));
    for row in 0..=rows {
        let (sin, cos) = (PI * row as f32 / rows as f32).sin_cos();
        for column in 0..=segments {
            let u = column as f32 / segments as f32;
            // The seam is one point, not two that differ by rounding.
            let (y, x) = if column == segments { (0.0, 1.0) } else { (TAU * u).sin_cos() };
            let sin = if row == rows { 0.0 } else { sin };
            let p = [sin * x, sin * y, cos];
            push(&mut mesh, p, p, [u, 1.0 - row as f32 / rows as f32]);
        }
    }
    let at = |row: u32, column: u32| row * (segments + 1) + column;
    for row in 0..rows {
        for column in 0..segments {
            let [a, b] = [at(row, column), at(row, column + 1)];
            let [c, d] = [at(row + 1, column), at(row + 1, column + 1)];
            // Each pole row has one triangle per segment; the other half of its quads has no area.
            if row + 1 < rows {
                mesh.indices.extend([a, c, d]);
            }
            if row > 0 {
                mesh.indices.extend([a, d, b]);
            }
        }
    }
    mesh
}

fn rectangle() -> Mesh {
    let mut mesh = Mesh { indices: vec![0, 1, 2, 0, 2, 3], ..Mesh::default() };
    for [u, v] in [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]] {
        push(&mut mesh, [2.0 * u - 1.0, 2.0 * v - 1.0, 0.0], [0.0, 0.0, 1.0], [u, v]);
    }
    mesh
}

fn cube() -> Mesh {
    let mut mesh = Mesh::default();
    for axis in 0..3 {
        for sign in [-1.0, 1.0] {
            let first = mesh.positions.len() as u32;
            for [u, v] in [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]] {
                let (mut p, mut n) = ([0.0; 3], [0.0; 3]);
                (p[axis], n[axis]) = (sign, sign);
                // Mirrored on negative sides, so that the corners run counter-clockwise seen from outside.
                p[(axis + 1) % 3] = sign * (2.0 * u - 1.0);
                p[(axis + 2) % 3] = 2.0 * v - 1.0;
                push(&mut mesh, p, n, [u, v]);
            }
            mesh.indices.extend([0, 1, 2, 0, 2, 3].map(|i| first + i));
        }
    }
    mesh
}

/// Texture coordinates are polar: u the radius, v the angle over a full turn.
fn disk(segments: u32) -> Mesh {
    let mut mesh = Mesh::default();
    for i in 0..segments {
        let first = mesh.positions.len() as u32;
        let v = [i, i + 1].map(|i| i as f32 / segments as f32);
        push(&mut mesh, [0.0; 3], [0.0, 0.0, 1.0], [0.0, v[0]]);
        for (k, v) in [(i, v[0]), ((i + 1) % segments, v[1])] {
            let (y, x) = (TAU * k as f32 / segments as f32).sin_cos();
            push(&mut mesh, [x, y, 0.0], [0.0, 0.0, 1.0], [1.0, v]);
        }
        mesh.indices.extend([first, first + 1, first + 2]);
    }
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    /// Area and signed volume of the closed or open surface.
    fn measure(mesh: &Mesh) -> (f32, f32) {
        let p = |i: u32| Vec3::from(mesh.positions[i as usize]);
        mesh.indices.chunks(3).fold((0.0, 0.0), |(area, volume), t| {
            let [a, b, c] = [p(t[0]), p(t[1]), p(t[2])];
            (area + (b - a).cross(c - a).length() / 2.0, volume + a.dot(b.cross(c)) / 6.0)
        })
    }

    #[test]
    fn shapes_are_closed_and_face_outward() {
        let (area, volume) = measure(&Shape::Cube.mesh(0));
        assert!(area == 24.0 && (volume - 8.0).abs() < 1e-5, "{area} {volume}");
        let (area, volume) = measure(&Shape::Sphere.mesh(256));
        assert!((area / (4.0 * PI) - 1.0).abs() < 1e-3 && (volume / (4.0 / 3.0 * PI) - 1.0).abs() < 1e-3);
        assert!((measure(&Shape::Disk.mesh(512)).0 / PI - 1.0).abs() < 1e-3);
        assert_eq!(measure(&Shape::Rectangle.mesh(0)).0, 4.0);
    }

    #[test]
    fn triangles_are_counted_before_they_are_made() {
        for shape in [Shape::Sphere, Shape::Rectangle, Shape::Cube, Shape::Disk] {
            for segments in [3, 4, 7, 64] {
                assert_eq!(shape.mesh(segments).indices.len() as u64 / 3, shape.triangles(segments), "{shape:?}");
            }
        }
    }

    #[test]
    fn a_sphere_has_no_triangle_without_area() {
        let mesh = Shape::Sphere.mesh(8);
        assert_eq!(mesh.indices.len() / 3, 8 * (1 + 2 + 2 + 1));
        let p = |i: u32| Vec3::from(mesh.positions[i as usize]);
        assert!(mesh.indices.chunks(3).all(|t| (p(t[1]) - p(t[0])).cross(p(t[2]) - p(t[0])).length() > 1e-3));
    }
}
