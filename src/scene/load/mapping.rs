//! How texture coordinates become places in a picture.
use crate::layout::{
    TEXTURE_CLAMP, TEXTURE_CLAMP_U, TEXTURE_CLAMP_V, TEXTURE_MIRROR_U, TEXTURE_MIRROR_V, TEXTURE_NEAREST,
    TEXTURE_SECOND_UV, TEXTURE_SHEARED,
};
use crate::scene::description::texture::{TextureFilter, TextureTable, Wrap};

/// How texture coordinates, whose v points up, become places in a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mapping {
    /// What is seen outside [0, 1] along u and v.
    pub wrap: [Wrap; 2],
    /// Values between texels.
    pub filter: TextureFilter,
    /// Whether the second set of a mesh's coordinates is read.
    pub second: bool,
    /// Factor of texture coordinates: the picture is read at `uv * scale + vu * shear + offset`.
    pub scale: [f32; 2],
    /// Factor of the other coordinate.
    pub shear: [f32; 2],
    /// Added to scaled texture coordinates.
    pub offset: [f32; 2],
}

impl Default for Mapping {
    fn default() -> Self {
        let (wrap, filter, second) = ([Wrap::Repeat; 2], TextureFilter::Linear, false);
        Self { wrap, filter, second, scale: [1.0; 2], shear: [0.0; 2], offset: [0.0; 2] }
    }
}

/// With w = 1 - v, which points down, (c, s) the cosine and sine of the turn, f the scale and o the offset, the extension
/// [KHR_texture_transform](https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Khronos/KHR_texture_transform) reads the
/// picture at `(o.x + c f.x u + s f.y w, o.y - s f.x u + c f.y w)`. In v, which points up, that is the mapping made here.
impl From<&TextureTable> for Mapping {
    fn from(t: &TextureTable) -> Self {
        // Quarters are exact, so that a picture that is turned by them stays sharp.
        let (s, c) = match t.rotate.rem_euclid(360.0) {
            0.0 => (0.0, 1.0),
            90.0 => (1.0, 0.0),
            180.0 => (0.0, -1.0),
            270.0 => (-1.0, 0.0),
            degrees => degrees.to_radians().sin_cos(),
        };
        let ([fx, fy], [x, y]) = (t.scale, t.offset);
        Self {
            wrap: t.wrap,
            filter: t.filter,
            second: t.uv == 1,
            scale: [c * fx, c * fy],
            shear: [-s * fy, s * fx],
            offset: [x + s * fy, 1.0 - y - c * fy],
        }
    }
}

impl Mapping {
    /// Where coordinates read the picture.
    pub fn applied(&self, [u, v]: [f32; 2]) -> [f32; 2] {
        let at = |i: usize, own: f32, other: f32| own * self.scale[i] + other * self.shear[i] + self.offset[i];
        [at(0, u, v), at(1, v, u)]
    }

    /// Distinguishes mappings that are not equal.
    pub fn bits(self) -> [u32; 7] {
        let [[a, b], [c, d], [e, f]] = [self.scale, self.shear, self.offset].map(|v| v.map(f32::to_bits));
        let modes = self.wrap.map(|wrap| wrap as u32);
        [modes[0] | modes[1] << 2 | (self.filter as u32) << 4 | u32::from(self.second) << 5, a, b, c, d, e, f]
    }

    /// TEXTURE_ bits of a texture of this mapping.
    pub fn flags(self) -> u32 {
        let [u, v] = self.wrap;
        let bits = [
            (u == Wrap::Clamp && v == Wrap::Clamp, TEXTURE_CLAMP),
            (u == Wrap::Clamp && v != Wrap::Clamp, TEXTURE_CLAMP_U),
            (u != Wrap::Clamp && v == Wrap::Clamp, TEXTURE_CLAMP_V),
            (u == Wrap::Mirror, TEXTURE_MIRROR_U),
            (v == Wrap::Mirror, TEXTURE_MIRROR_V),
            (self.filter == TextureFilter::Nearest, TEXTURE_NEAREST),
            (self.shear != [0.0; 2], TEXTURE_SHEARED),
            (self.second, TEXTURE_SECOND_UV),
        ];
        bits.iter().filter(|b| b.0).map(|b| b.1).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where the mapping reads, with v down before and after.
    fn read(t: &TextureTable, [u, w]: [f32; 2]) -> [f32; 2] {
        let [x, y] = Mapping::from(t).applied([u, 1.0 - w]);
        [x, 1.0 - y]
    }

    #[test]
    fn coordinates_are_those_of_the_extension() {
        let t = TextureTable { offset: [0.25, 0.5], rotate: 30.0, scale: [2.0, 3.0], ..TextureTable::default() };
        let (s, c) = 30f32.to_radians().sin_cos();
        for [u, w] in [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.3, 0.9]] {
            // The matrix product of the extension: translation, rotation, scale.
            let (x, y) = (2.0 * u, 3.0 * w);
            let expected = [0.25 + c * x + s * y, 0.5 - s * x + c * y];
            let found = read(&t, [u, w]);
            assert!((0..2).all(|i| (found[i] - expected[i]).abs() < 1e-6), "{found:?} {expected:?}");
        }
        assert_eq!(Mapping::from(&TextureTable::default()), Mapping::default());
        let turned = TextureTable { rotate: 90.0, ..TextureTable::default() };
        assert_eq!(read(&turned, [1.0, 0.0]), [0.0, -1.0], "counter-clockwise, since v points down");
    }
}
