//! Faces of more than three corners as triangles. Small convex ones become fans; others are cut by earcut (Held 2001) in the
//! plane of their Newell normal, and edges flipped until they are Delaunay's: triangles that all share a corner have
//! boxes inside boxes.
use earcut::{Earcut, Refiner};
use glam::{DVec2, DVec3};

/// Corners up to which a convex face is a fan, as other readers of OBJ files have it.
const FAN: usize = 16;
/// Corners of a face that is still cut, in time that may grow with their square; a larger one becomes a fan.
const MOST_CORNERS: usize = 100_000;

/// Cuts faces; what they share is memory.
pub struct Triangulator {
    earcut: Earcut<f64>,
    refiner: Refiner,
    corners: Vec<u32>,
    points: Vec<DVec3>,
    flat: Vec<[f64; 2]>,
}

impl Default for Triangulator {
    fn default() -> Self {
        let (corners, points, flat) = Default::default();
        Self { earcut: Earcut::new(), refiner: Refiner::new(), corners, points, flat }
    }
}

impl Triangulator {
    /// Adds the triangles of a face of three corners or more, its winding kept. Corners that form no area may be left without
    /// triangles, or with triangles of none; a face always has some.
    pub fn add(&mut self, positions: &[[f32; 3]], face: &[u32], triangles: &mut Vec<u32>) {
        if let [_, _, _] = face {
            triangles.extend(face);
            return;
        }
        self.flatten(positions, face);
        self.corners.clear();
        if (face.len() > FAN || !is_convex(&self.flat)) && face.len() <= MOST_CORNERS {
            self.earcut.earcut_slice(&self.flat, &[], &mut self.corners);
            self.refiner.refine(&mut self.corners, &self.flat);
        }
        // Of a face without area (as a whole: it may cross itself) nothing may be left.
        match self.corners.is_empty() {
            true => triangles.extend(face[1..].windows(2).flat_map(|w| [face[0], w[0], w[1]])),
            false => triangles.extend(self.corners.iter().map(|&corner| face[corner as usize])),
        }
    }

    /// The corners seen along the face's normal, counter-clockwise as a whole.
    fn flatten(&mut self, positions: &[[f32; 3]], face: &[u32]) {
        let point = |&i: &u32| DVec3::from(positions[i as usize].map(f64::from));
        let first = point(&face[0]);
        self.points.clear();
        self.points.extend(face.iter().map(|i| point(i) - first));
        let normal: DVec3 = self.points.windows(2).map(|w| w[0].cross(w[1])).sum();
        let size = normal.abs();
        let drop_axis = |p: &DVec3| match size.max_element() {
            m if m == size.x => [p.y, p.z * normal.x.signum()],
            m if m == size.y => [p.z, p.x * normal.y.signum()],
            _ => [p.x, p.y * normal.z.signum()],
        };
        self.flat.clear();
        self.flat.extend(self.points.iter().map(drop_axis));
    }
}

/// Whether every corner turns left.
fn is_convex(flat: &[[f64; 2]]) -> bool {
    let at = |i: usize| DVec2::from(flat[i % flat.len()]);
    (0..flat.len()).all(|i| (at(i + 1) - at(i)).perp_dot(at(i + 2) - at(i)) > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sum of the areas, and how many triangles face against `normal`.
    fn measure(positions: &[[f32; 3]], triangles: &[u32], normal: DVec3) -> (f64, usize) {
        let point = |i: u32| DVec3::from(positions[i as usize].map(f64::from));
        let areas: Vec<f64> = triangles
            .chunks(3)
            .map(|t| 0.5 * (point(t[1]) - point(t[0])).cross(point(t[2]) - point(t[0])).dot(normal))
            .collect();
        (areas.iter().map(|a| a.abs()).sum(), areas.iter().filter(|&&a| a < -1e-9).count())
    }

    fn triangulated(positions: &[[f32; 3]], face: &[u32]) -> Vec<u32> {
        let mut triangles = Vec::new();
        Triangulator::default().add(positions, face, &mut triangles);
        triangles
    }

    fn fan(corners: u32) -> Vec<u32> {
        (2..corners).flat_map(|i| [0, i - 1, i]).collect()
    }

    /// Corners (x, y) placed on a plane, and its unit normal.
    fn placed(points: &[(f64, f64)], x: DVec3, y: DVec3) -> (Vec<[f32; 3]>, DVec3) {
        let at = |&(u, v): &(f64, f64)| (DVec3::new(3.0, -2.0, 5.0) + u * x + v * y).as_vec3().to_array();
        (points.iter().map(at).collect(), x.cross(y))
    }

    const L: [(f64, f64); 6] = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (2.0, 1.0), (2.0, 2.0), (0.0, 2.0)];

    #[test]
    fn concave_faces_keep_their_area_on_every_plane_and_in_both_windings() {
        let tilted = DVec3::new(1.0, 2.0, 2.0) / 3.0;
        let planes = [(DVec3::X, DVec3::Y), (DVec3::Z, DVec3::X), (DVec3::Y, DVec3::Z), (DVec3::Z, DVec3::Y)];
        for (x, y) in planes.into_iter().chain([(tilted, tilted.any_orthonormal_vector())]) {
            for start in 0..6 {
                let mut points = L;
                points.rotate_left(start);
                let (positions, normal) = placed(&points, x, y);
                let triangles = triangulated(&positions, &[0, 1, 2, 3, 4, 5]);
                let (area, against) = measure(&positions, &triangles, normal);
                assert!((area - 3.0).abs() < 1e-5 && against == 0 && triangles.len() == 12, "{x} {y} {start}: {area}");
                let reversed = triangulated(&positions, &[5, 4, 3, 2, 1, 0]);
                assert_eq!(measure(&positions, &reversed, -normal).1, 0, "{x} {y} {start}");
            }
        }
        let (positions, normal) = placed(&[L[1], L[2], L[3], L[4], L[5], L[0]], DVec3::X, DVec3::Y);
        let (area, against) = measure(&positions, &fan(6), normal);
        assert!(area > 3.1 && against > 0, "control: a fan covers too much");
    }

    #[test]
    fn random_stars_keep_their_area() {
        let mut random = fastrand::Rng::with_seed(1);
        for n in 4..60 {
            let point = |i: usize, r: f64| {
                let angle = std::f64::consts::TAU * i as f64 / n as f64;
                (r * angle.cos(), r * angle.sin())
            };
            let points: Vec<_> = (0..n).map(|i| point(i, 0.1 + random.f64())).collect();
            let exact = (0..n).map(|i| (points[i], points[(i + 1) % n])).map(|(a, b)| 0.5 * (a.0 * b.1 - a.1 * b.0));
            let exact: f64 = exact.sum();
            let (positions, normal) = placed(&points, DVec3::Y, DVec3::Z);
            let triangles = triangulated(&positions, &(0..n as u32).collect::<Vec<_>>());
            let (area, against) = measure(&positions, &triangles, normal);
            assert!((area / exact - 1.0).abs() < 1e-5 && against == 0, "{n} corners: {area} of {exact}");
            assert_eq!(triangles.len(), 3 * (n - 2));
        }
    }

    #[test]
    fn a_comb_and_a_round_face_keep_their_area() {
        // Teeth as wide as the gaps between them, on a bar as high as they are.
        let comb = |teeth: usize| {
            let tooth = |i: usize| {
                let x = (2 * (teeth - i)) as f64;
                [(x - 1.0, 0.0), (x - 1.0, 1.0), (x - 2.0, 1.0), (x - 2.0, 0.0)]
            };
            let bar = [(0.0, -1.0), ((2 * teeth - 1) as f64, -1.0)];
            bar.into_iter().chain((0..teeth).flat_map(tooth)).collect::<Vec<_>>()
        };
        let round = |n: usize| -> Vec<_> {
            (0..n).map(|i| (std::f64::consts::TAU * i as f64 / n as f64).sin_cos()).map(|(y, x)| (x, y)).collect()
        };
        for (points, exact) in [(comb(250), 749.0), (comb(2500), 7499.0), (round(10_000), std::f64::consts::PI)] {
            let count = points.len() as u32;
            let (positions, normal) = placed(&points, DVec3::Y, DVec3::Z);
            let triangles = triangulated(&positions, &(0..count).collect::<Vec<_>>());
            let (area, against) = measure(&positions, &triangles, normal);
            assert!((area / exact - 1.0).abs() < 1e-5 && against == 0, "{count} corners: {area} of {exact}");
            let corners: std::collections::BTreeSet<_> = triangles.iter().collect();
            assert_eq!(corners.len(), points.len(), "every corner is kept");
        }
    }

    #[test]
    fn convex_faces_are_fans_and_broken_ones_come_to_an_end() {
        let square = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];
        let (positions, _) = placed(&square, DVec3::X, DVec3::Y);
        assert_eq!(triangulated(&positions, &[0, 1, 2, 3]), [0, 1, 2, 0, 2, 3]);
        assert_eq!(triangulated(&positions, &[0, 1, 2]), [0, 1, 2]);
        assert_eq!(triangulated(&positions, &[0, 2, 1, 3]).len(), 6, "a face that crosses itself");
        assert_eq!(triangulated(&positions, &[1, 1, 1, 1, 1]).len(), 9, "a face without area");
        assert_eq!(triangulated(&[[f32::NAN; 3]; 4], &[0, 1, 2, 3]).len(), 6);
        // A corner in the middle of an edge: nothing is lost, whichever comes first.
        let (positions, normal) =
            placed(&[(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (2.0, 1.0), (0.0, 1.0)], DVec3::X, DVec3::Y);
        let (area, against) = measure(&positions, &triangulated(&positions, &[0, 1, 2, 3, 4]), normal);
        assert!((area - 2.0).abs() < 1e-6 && against == 0, "{area}");
    }
}
