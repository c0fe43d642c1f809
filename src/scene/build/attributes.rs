//! Packs what some meshes have at their vertices beyond normals and texture coordinates into words, as `Shading` describes them.
use super::encode::encode_normal;
use crate::layout::{ATTRIBUTE_COLORS, ATTRIBUTE_FLIPPED, ATTRIBUTE_SECOND_UV, ATTRIBUTE_TANGENTS};
use glam::{DMat3, Vec2, Vec4};

/// At the corners of one triangle.
#[derive(Clone, Copy, Debug, Default)]
pub struct Extras {
    /// Linear colours and opacities.
    pub colors: Option<[Vec4; 3]>,
    /// Second texture coordinates.
    pub uvs: Option<[Vec2; 3]>,
    /// Tangents of any length, and the signs of the bitangents.
    pub tangents: Option<[Vec4; 3]>,
}

/// Words of a triangle with all of them.
pub const MOST_WORDS: usize = 15;

/// How many words follow each other for these ATTRIBUTE_ bits.
pub fn words_of(bits: u32) -> u32 {
    let sizes = [(ATTRIBUTE_COLORS, 6), (ATTRIBUTE_SECOND_UV, 6), (ATTRIBUTE_TANGENTS, 3)];
    sizes.iter().filter(|(bit, _)| bits & bit != 0).map(|(_, words)| words).sum()
}

impl Extras {
    /// Adds the words; returns the ATTRIBUTE_ bits. `matrix` places tangents. `swap`: corners 1 and 2 change places, which a
    /// mirror calls for.
    pub fn pack(&self, matrix: &DMat3, swap: bool, words: &mut Vec<u32>) -> u32 {
        let mut bits = 0;
        let order = if swap { [0, 2, 1] } else { [0, 1, 2] };
        if let Some(colors) = self.colors {
            bits |= ATTRIBUTE_COLORS;
            let unorm = |v: f32| (v.clamp(0.0, 1.0) * 65535.0).round() as u32; // of NaN, 0
            for c in order.map(|i| colors[i]) {
                words.extend([unorm(c.x) | unorm(c.y) << 16, unorm(c.z) | unorm(c.w) << 16]);
            }
        }
        if let Some(uvs) = self.uvs.filter(|uvs| uvs.iter().all(|uv| uv.is_finite())) {
            bits |= ATTRIBUTE_SECOND_UV;
            words.extend(order.iter().flat_map(|&i| uvs[i].to_array().map(f32::to_bits)));
        }
        let placed = |t: Vec4| (*matrix * t.truncate().as_dvec3()).try_normalize().map(|t| encode_normal(t.as_vec3()));
        if let Some([Some(a), Some(b), Some(c)]) = self.tangents.map(|t| order.map(|i| placed(t[i]))) {
            bits |= ATTRIBUTE_TANGENTS;
            // A mirror turns the cross product of normal and tangent around, and so does a normal that is turned around.
            let negative = self.tangents.is_some_and(|t| t[0].w < 0.0);
            bits |= if negative != swap { ATTRIBUTE_FLIPPED } else { 0 };
            words.extend([a, b, c]);
        }
        bits
    }
}

/// Three corners of an array that may be empty.
pub fn corners<T: Copy, U: From<T>>(values: &[T], corners: [usize; 3]) -> Option<[U; 3]> {
    (!values.is_empty()).then(|| corners.map(|i| values[i].into()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mirror_turns_the_bitangent_around() {
        let tangents = Some([Vec4::new(1.0, 0.0, 0.0, 1.0); 3]);
        let extras = Extras { colors: Some([Vec4::new(0.5, 2.0, f32::NAN, 1.0); 3]), tangents, ..Extras::default() };
        let mut words = Vec::new();
        let bits = extras.pack(&DMat3::IDENTITY, false, &mut words);
        assert_eq!((bits, words.len() as u32), (ATTRIBUTE_COLORS | ATTRIBUTE_TANGENTS, words_of(bits)));
        assert_eq!([words[0], words[1]], [32768 | 65535 << 16, 65535 << 16]);
        let mirror = DMat3::from_diagonal(glam::dvec3(-1.0, 1.0, 1.0));
        assert_ne!(extras.pack(&mirror, true, &mut words) & ATTRIBUTE_FLIPPED, 0);
        let none = Extras { tangents: Some([Vec4::ZERO; 3]), ..Extras::default() };
        assert_eq!(none.pack(&DMat3::IDENTITY, false, &mut words), 0);
        assert_eq!(words_of(15), MOST_WORDS as u32);
        assert_eq!(corners::<_, glam::Vec3>(&[[1.0, 2.0, 3.0]; 2], [0, 1, 1]).map(|c| c[2].z), Some(3.0));
    }
}
