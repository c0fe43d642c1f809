//! Splits triangles whose emission is a picture into smaller lamps, which light sampling chooses by their own brightness: a point of one
//! triangle is drawn evenly, and most of a picture may be dark. Neighbours are cut at the same points. Where parts of two sizes meet, the
//! corner of one lies on the edge of the other up to the rounding of its coordinates, a gap that no image shows: of 200 million rays onto
//! such a lamp, one passed through it.
use super::attributes::Extras;
use super::brightness::{luminance_at, mean_luminance, points, texels};
use super::geometry::Corners;
use crate::layout::{Material, NONE, TEXTURE_SECOND_UV};
use crate::scene::Scene;
use glam::{DAffine3, Vec2, Vec3, Vec4};
use std::borrow::Cow;
use std::ops::{Add, Mul};
use std::slice;

/// Triangles that all lamps of a scene are split into at most. Meshes with more than a quarter of that stay as they are. A screen of 1760
/// lamps takes the time of one of 488, at half of its noise or the same.
const MOST: u64 = 4096;
/// How often a triangle and its parts are quartered at most.
const MOST_DEPTH: u32 = 6;
/// Texels of the smallest parts, about: what lies between two texels is a blend of them.
const LEAST_TEXELS: f32 = 2.0;
/// Share of a lamp's light by which it may be sampled too seldom, so that more parts are not worth it.
const TOLERANCE: f64 = 0.05;
/// Points of the smallest parts at which pictures are read.
const POINTS: u32 = 16;
/// Least edge of a part beside its coordinates: their rounding must not change its shape.
const LEAST_EDGE: f32 = 1e-3;

/// How often triangles of each mesh may be quartered, given how many triangles with an emission picture each of them shows.
pub fn depths(lamps: &[u64]) -> Vec<u32> {
    let splits = |&count: &u64| (1..=MOST / 4).contains(&count);
    let share = MOST / (lamps.iter().filter(|n| splits(n)).count() as u64).max(1);
    let most = |count: u64| (0..=MOST_DEPTH).rev().find(|&depth| count << (2 * depth) <= share).unwrap_or(0);
    lamps.iter().map(|count| if splits(count) { most(*count) } else { 0 }).collect()
}

/// What tells how bright lamps are.
#[derive(Clone, Copy)]
pub struct Lamps<'s> {
    /// A scene of which the pictures are known.
    pub scene: &'s Scene,
    /// Those of the scene, which does not hold them until its triangles are placed.
    pub materials: &'s [Material],
}

/// Whether a material's picture shines, so that its triangles may be split.
pub fn is_pictured(m: &Material) -> bool {
    m.emission_texture != NONE && m.emission != [0.0; 3]
}

/// A part of a triangle: the mean of its luminance and of the square, and what it is split into.
struct Part {
    mean: f64,
    square: f64,
    parts: Vec<Corners>,
}

impl Lamps<'_> {
    /// Whether triangles of a material may be split.
    pub fn has_picture(&self, material: u32) -> bool {
        self.pictured(material).is_some()
    }

    /// A material whose picture shines; the grey of meshes without material is added last.
    fn pictured(&self, material: u32) -> Option<&Material> {
        self.materials.get(material as usize).filter(|m| is_pictured(m))
    }

    /// A triangle, or its parts where its picture shines unevenly: quartered up to `depth` times, as far as there is room where `placed`
    /// puts it.
    pub fn split<'c>(&self, c: &'c Corners, material: u32, depth: u32, placed: &DAffine3) -> Cow<'c, [Corners]> {
        let whole = Cow::Borrowed(slice::from_ref(c));
        let Some(m) = self.pictured(material).filter(|_| depth > 0) else { return whole };
        let texels = texels(self.scene, m, |image| self.coordinates(c, image)) / LEAST_TEXELS;
        let corners = c.p.map(|p| placed.transform_point3(p.as_dvec3()).as_vec3());
        let depth = depth.min(depth_for(texels)).min(depth_for(room(corners).powi(2)));
        let tolerance = TOLERANCE * mean_luminance(self.scene, m) / 4f64.powi(depth as i32);
        let Part { parts, .. } = self.parts(&prepared(c), m, depth, tolerance);
        if parts.len() == 1 { whole } else { parts.into() }
    }

    /// Quarters a triangle where even sampling wastes more than `tolerance` times its area.
    fn parts(&self, c: &Corners, m: &Material, depth: u32, tolerance: f64) -> Part {
        if depth == 0 {
            let mean = points(POINTS).map(|b| self.luminance(c, m, b)).sum::<f64>() / f64::from(POINTS);
            return Part { mean, square: mean * mean, parts: vec![*c] };
        }
        let quarters = quarters(c).map(|quarter| self.parts(&quarter, m, depth - 1, 4.0 * tolerance));
        let [mean, square] =
            [|q: &Part| q.mean, |q: &Part| q.square].map(|of| quarters.iter().map(of).sum::<f64>() / 4.0);
        let waste = square - mean * mean;
        let parts = match waste > tolerance * mean {
            true => quarters.into_iter().flat_map(|quarter| quarter.parts).collect(),
            false => vec![*c],
        };
        Part { mean, square, parts }
    }

    fn luminance(&self, c: &Corners, m: &Material, b: Vec2) -> f64 {
        luminance_at(self.scene, m, |image| {
            let [uv0, uv1, uv2] = self.coordinates(c, image);
            uv0 + b.x * (uv1 - uv0) + b.y * (uv2 - uv0)
        })
    }

    fn coordinates(&self, c: &Corners, image: u32) -> [Vec2; 3] {
        let second = self.scene.textures[image as usize].flags & TEXTURE_SECOND_UV != 0;
        c.extras.uvs.filter(|_| second).or(c.uv).unwrap_or_default()
    }
}

/// How often something can be quartered into parts of at least 1; of what is not a number, 0.
fn depth_for(size: f32) -> u32 {
    (size.max(1.0).log2() / 2.0) as u32
}

/// Into how many parts the longest edge may be cut.
fn room(p: [Vec3; 3]) -> f32 {
    let [a, b, c] = p;
    let far = p.iter().map(|p| p.abs().max_element()).fold(0.0, f32::max);
    (b - a).length().max((c - b).length()).max((a - c).length()) / (LEAST_EDGE * far)
}

/// Corners whose normals and tangents may be interpolated as kernels do.
fn prepared(c: &Corners) -> Corners {
    let tangents = c.extras.tangents.map(|t| t.map(|v| v.truncate().normalize_or_zero().extend(t[0].w)));
    Corners { n: c.n.map(|n| n.map(Vec3::normalize_or_zero)), extras: Extras { tangents, ..c.extras }, ..*c }
}

/// Four parts of a quarter of the area each, cut at the middles of the edges: at the corners, and the one between. All is interpolated.
fn quarters(c: &Corners) -> [Corners; 4] {
    let (p, n, uv) = (cut(c.p), c.n.map(cut), c.uv.map(cut));
    let Extras { colors, uvs, tangents } = c.extras;
    let (colors, uvs, tangents) = (colors.map(cut::<Vec4>), uvs.map(cut), tangents.map(cut));
    std::array::from_fn(|i| Corners {
        p: p[i],
        n: n.map(|n| n[i]),
        uv: uv.map(|uv| uv[i]),
        extras: Extras { colors: colors.map(|c| c[i]), uvs: uvs.map(|uv| uv[i]), tangents: tangents.map(|t| t[i]) },
    })
}

/// Values at the corners of the parts, given those at the corners of the whole.
fn cut<T: Copy + Add<Output = T> + Mul<f32, Output = T>>([a, b, c]: [T; 3]) -> [[T; 3]; 4] {
    let middle = |a: T, b: T| a * 0.5 + b * 0.5;
    let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
    [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::{TEXTURE_RGB9E5, Texture};
    use crate::math::rgb9e5;
    use crate::scene::build::brightness::read_pictures;
    use glam::{DVec3, vec2, vec3};

    const EDGE: u32 = 16;
    /// Of half a sheet, whose picture is `EDGE` texels wide.
    const HALF: Corners = Corners {
        p: [vec3(1.0, 2.0, 3.0), vec3(3.0, 2.0, 3.0), vec3(3.0, 2.0, 6.0)],
        n: Some([Vec3::Y; 3]),
        uv: Some([vec2(0.0, 0.0), vec2(1.0, 0.0), vec2(1.0, 1.0)]),
        extras: Extras { colors: None, uvs: None, tangents: None },
    };

    fn split(value: impl Fn(u32, u32) -> f32, depth: u32) -> Vec<Corners> {
        split_at(0.0, value, depth)
    }

    /// So far away along each axis.
    fn split_at(far: f64, value: impl Fn(u32, u32) -> f32, depth: u32) -> Vec<Corners> {
        let texels = (0..EDGE * EDGE).map(|i| rgb9e5::pack([value(i % EDGE, i / EDGE); 3])).collect();
        let flags = TEXTURE_RGB9E5;
        let picture = Texture { width: EDGE, height: EDGE, scale: [1.0; 2], flags, ..Texture::default() };
        let mut scene = Scene { textures: vec![picture], texels, ..Scene::default() };
        let materials = [Material { emission: [5.0; 3], emission_texture: 0, ..Material::default() }];
        read_pictures(&materials, &mut scene);
        Lamps { scene: &scene, materials: &materials }
            .split(&HALF, 0, depth, &DAffine3::from_translation(DVec3::splat(far)))
            .into_owned()
    }

    fn area(c: &Corners) -> f64 {
        crate::scene::build::geometry::area(c.p.map(|p| p.to_array()))
    }

    /// A bright patch of 3 by 3 texels.
    fn patch(x: u32, y: u32) -> f32 {
        if (10..13).contains(&x) && (9..12).contains(&y) { 1.0 } else { 0.02 }
    }

    #[test]
    fn parts_lie_where_the_picture_is_uneven_and_make_up_the_whole() {
        let parts = split(patch, 6);
        let areas: Vec<f64> = parts.iter().map(area).collect();
        // 128 texels, of which the smallest parts have two.
        assert!((10..64).contains(&parts.len()), "{}", parts.len());
        assert!((areas.iter().sum::<f64>() - 3.0).abs() < 1e-9);
        let least = areas.iter().copied().fold(f64::INFINITY, f64::min);
        assert!((least - 3.0 / 64.0).abs() < 1e-9, "{least}");
        for c in &parts {
            let normal = (c.p[1] - c.p[0]).cross(c.p[2] - c.p[0]);
            assert!(normal.y < 0.0 && c.n == HALF.n, "turned around: {c:?}");
            // Coordinates stay with the places.
            let [p, uv] = [c.p[2] - HALF.p[0], c.uv.unwrap()[2].extend(0.0)];
            assert!((p.x - 2.0 * uv.x).abs() < 1e-6 && (p.z - 3.0 * uv.y).abs() < 1e-6);
        }
    }

    #[test]
    fn triangles_without_contrast_or_room_stay_whole() {
        assert_eq!(split(|_, _| 0.7, 6).len(), 1);
        assert_eq!(split(|_, _| 0.0, 6).len(), 1);
        assert_eq!(split(patch, 0).len(), 1);
        assert!(split(patch, 2).len() <= 16);
        assert_eq!(depth_for(f32::NAN), 0);
        let far = HALF.p.map(|p| p + 1e4);
        assert!(room(far) < 1.0 && room(HALF.p) > 500.0);
        assert_eq!(split_at(1e4, patch, 6).len(), 1, "where it is placed there is no room");
        assert!(split_at(100.0, patch, 6).len() > 4, "control");
    }

    #[test]
    fn what_all_lamps_are_split_into_is_limited() {
        assert_eq!(depths(&[2, 0]), [5, 0]);
        assert_eq!(depths(&[2, 100_000, 2]), [5, 0, 5]);
        assert_eq!(depths(&[0, 0]), [0, 0]);
        for counts in [vec![2; 100], vec![1; 5000], vec![900, 2, 30], vec![1024]] {
            let parts: u64 =
                counts.iter().zip(depths(&counts)).map(|(n, depth)| if depth > 0 { n << (2 * depth) } else { 0 }).sum();
            assert!(parts <= MOST, "{counts:?}");
        }
    }
}
