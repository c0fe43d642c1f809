//! Twin of `glsl/shared/sampler.glsl`: the words agree with `==`.
use crate::math::hash::{pcg, unit_interval};
use glam::Vec2;

/// State of one sample's random numbers: everything they depend on but the dimension.
#[derive(Clone, Copy, Debug)]
pub struct Sampler {
    /// Hash of pixel and seed.
    pub seed: u32,
    /// Sample index; bit-reversed for Sobol points.
    pub index: u32,
    /// Whether numbers are PCG's, not Sobol points (`FX_INDEPENDENT` in the shader).
    pub independent: bool,
}

/// Owen scrambling of a bit-reversed word: Laine-Karras with Vegdahl's constants.
pub fn owen_reversed(mut x: u32, seed: u32) -> u32 {
    x ^= x.wrapping_mul(0x3d20adea);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul((seed >> 16) | 1);
    x ^= x.wrapping_mul(0x05526c56);
    x ^ x.wrapping_mul(0x53a22864)
}

/// Second Sobol dimension of `index`, bit-reversed.
pub fn sobol_1_reversed(mut index: u32) -> u32 {
    index ^= (index >> 1) & 0x55555555;
    index ^= (index >> 2) & 0x33333333;
    index ^= (index >> 4) & 0x0f0f0f0f;
    index ^= (index >> 8) & 0x00ff00ff;
    index ^ (index >> 16)
}

/// The stream of sample `index` of `pixel` under `seed`.
pub fn sampler_start(pixel: u32, index: u32, seed: u32, independent: bool) -> Sampler {
    let index = if independent { index } else { index.reverse_bits() };
    Sampler { seed: pcg(pixel.wrapping_add(pcg(seed))), index, independent }
}

/// Raw words for dimensions 2 * `pair` and 2 * `pair` + 1.
pub fn sample_2d_bits(s: Sampler, pair: u32) -> [u32; 2] {
    let h = pcg(s.seed.wrapping_add(pair));
    if s.independent {
        let x = pcg(h.wrapping_add(s.index));
        return [x, pcg(x ^ h)];
    }
    let hx = (h ^ (h >> 15)).wrapping_mul(0x2c1b3c6d);
    let hy = (h ^ (h >> 12)).wrapping_mul(0x297a2d39);
    let index = owen_reversed(s.index, h).reverse_bits();
    let x = owen_reversed(index, hx ^ (hx >> 16));
    let y = owen_reversed(sobol_1_reversed(index), hy ^ (hy >> 15));
    [x.reverse_bits(), y.reverse_bits()]
}

/// Two numbers in [0, 1), from the upper 24 bits of each word.
pub fn unit_floats(bits: [u32; 2]) -> Vec2 {
    Vec2::new(unit_interval(bits[0]), unit_interval(bits[1]))
}

/// Two numbers in [0, 1).
pub fn sample_2d(s: Sampler, pair: u32) -> Vec2 {
    unit_floats(sample_2d_bits(s, pair))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn second_dimension_solves_the_worked_example() {
        // First points of Sobol's second dimension: 0, 1/2, 3/4, 1/4, 5/8, 1/8, 3/8, 7/8 (Sobol, without Gray code).
        let eighths: Vec<u32> = (0..8).map(|i| sobol_1_reversed(i).reverse_bits() >> 29).collect();
        assert_eq!(eighths, [0, 4, 6, 2, 5, 1, 3, 7]);
    }

    #[test]
    fn largest_word_stays_below_one() {
        assert_eq!(unit_floats([u32::MAX, 0]), Vec2::new(1.0 - 2f32.powi(-24), 0.0));
    }
}
