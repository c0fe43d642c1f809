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
