//! Twin of `glsl/shared/pcg.glsl`: the words are equal.

/// PCG-RXS-M-XS as a hash, a bijection (Jarzynski and Olano 2020).
pub fn pcg(x: u32) -> u32 {
    let x = x.wrapping_mul(747796405).wrapping_add(2891336453);
    let x = ((x >> ((x >> 28) + 4)) ^ x).wrapping_mul(277803737);
    (x >> 22) ^ x
}

/// A number in [0, 1), from the upper 24 bits.
pub fn unit_interval(bits: u32) -> f32 {
    (bits >> 8) as f32 * 5.9604644775390625e-8
}

/// A word that [`unit_interval`] makes `u` of, from 0 on, but for rounding down to 24 bits; 1 and more count as the largest number below.
/// The other bits are those of `fill`.
pub fn word_of_unit(u: f32, fill: u32) -> u32 {
    ((u * 16_777_216.0) as u32).min(0xff_ffff) << 8 | fill & 0xff
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_of_numbers_give_them_back() {
        for bits in [0, 1, 0x1234_5678, u32::MAX] {
            assert_eq!(word_of_unit(unit_interval(bits), bits), bits);
        }
        assert_eq!([1.0, 1e9].map(|u| word_of_unit(u, 0x1_23)), [0xffff_ff23; 2]);
    }
}
