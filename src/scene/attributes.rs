//! Twin of `glsl/shared/attributes.glsl`: what some meshes have at their vertices beyond normals and texture coordinates.
use crate::layout::{ATTRIBUTE_COLORS, ATTRIBUTE_FLIPPED, ATTRIBUTE_SECOND_UV, ATTRIBUTE_TANGENTS, Shading};
use crate::math::octahedral::octahedral_decode;
use crate::scene::Scene;
use glam::{Vec2, Vec4, vec2};

/// The words of one triangle, in the order colours, second coordinates, tangents.
pub struct Attributes<'a> {
    bits: u32,
    words: &'a [u32],
}

impl<'a> Attributes<'a> {
    /// Those of a record.
    pub fn of(scene: &'a Scene, s: &Shading) -> Self {
        let words = if s.attributes == 0 { &[] } else { &scene.texels[s.first as usize..] };
        Self { bits: s.attributes, words }
    }

    fn has(&self, bit: u32) -> bool {
        self.bits & bit != 0
    }

    /// Linear colour and opacity at a point; white where there is none.
    pub fn color(&self, b: Vec2) -> Vec4 {
        if !self.has(ATTRIBUTE_COLORS) {
            return Vec4::ONE;
        }
        let unpack = |word: u32| [word & 0xffff, word >> 16].map(|v| v as f32 / 65535.0);
        let corner = |i: usize| {
            let ([r, g], [b, a]) = (unpack(self.words[2 * i]), unpack(self.words[2 * i + 1]));
            Vec4::new(r, g, b, a)
        };
        corner(0) + b.x * (corner(1) - corner(0)) + b.y * (corner(2) - corner(0))
    }

    /// The second set of texture coordinates at the corners, where there is one.
    pub fn second_coordinates(&self) -> Option<[Vec2; 3]> {
        let words =
            self.has(ATTRIBUTE_SECOND_UV).then(|| &self.words[if self.has(ATTRIBUTE_COLORS) { 6 } else { 0 }..])?;
        Some([0, 2, 4].map(|i| vec2(f32::from_bits(words[i]), f32::from_bits(words[i + 1]))))
    }

    /// Tangent at a point, not normalised, and the sign of the bitangent; all 0 where there is none.
    pub fn tangent(&self, b: Vec2) -> Vec4 {
        if !self.has(ATTRIBUTE_TANGENTS) {
            return Vec4::ZERO;
        }
        let at = [ATTRIBUTE_COLORS, ATTRIBUTE_SECOND_UV].iter().filter(|&&bit| self.has(bit)).count() * 6;
        let [t0, t1, t2] = [0, 1, 2].map(|i| octahedral_decode(self.words[at + i]));
        let sign = if self.has(ATTRIBUTE_FLIPPED) { -1.0 } else { 1.0 };
        (t0 + b.x * (t1 - t0) + b.y * (t2 - t0)).extend(sign)
    }
}
