//! Three positive numbers in 32 bits: mantissas of 9 bits that share an exponent of 5, as `E5B9G9R9` of Vulkan has them. Twin of
//! `glsl/shared/texture.glsl`.

/// Largest number that it holds.
pub const LARGEST: f32 = 65408.0;

/// The nearest numbers that it holds; of negative ones and NaN, 0.
pub fn pack(rgb: [f32; 3]) -> u32 {
    let rgb = rgb.map(|v| if v > 0.0 { v.min(LARGEST) } else { 0.0 });
    let largest = rgb[0].max(rgb[1]).max(rgb[2]);
    let exponent = ((largest.to_bits() >> 23) as i32 - 127).max(-16) + 16;
    // Rounding may carry into a tenth bit.
    let carries = mantissa(largest, exponent as u32) > 511;
    let exponent = exponent as u32 + u32::from(carries);
    let [r, g, b] = rgb.map(|v| mantissa(v, exponent));
    r | g << 9 | b << 18 | exponent << 27
}

fn mantissa(v: f32, exponent: u32) -> u32 {
    (v / unit(exponent)).round() as u32
}

/// What a mantissa of 1 stands for.
fn unit(exponent: u32) -> f32 {
    f32::from_bits((exponent + 103) << 23) // 2^(exponent - 24)
}

/// Whether one of the numbers is [`LARGEST`].
pub fn is_largest(word: u32) -> bool {
    word >> 27 == 31 && [0, 9, 18].iter().any(|shift| word >> shift & 511 == 511)
}

/// The numbers that a word holds.
pub fn unpack(word: u32) -> [f32; 3] {
    [0, 9, 18].map(|shift| (word >> shift & 511) as f32 * unit(word >> 27))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_come_back_to_within_half_a_unit_of_the_largest() {
        for exact in [[1.0, 0.5, 0.0], [511.0, 1.0, 0.0], [LARGEST, 0.0, 128.0], [2f32.powi(-24), 0.0, 0.0], [0.0; 3]] {
            assert_eq!(unpack(pack(exact)), exact);
        }
        for k in 0..2000 {
            let v = 1e-4 * 1.01f32.powi(k);
            let rgb = [v.min(LARGEST), 0.3 * v.min(LARGEST), 0.0];
            let error = (0..3).map(|i| (unpack(pack(rgb))[i] - rgb[i]).abs()).fold(0.0, f32::max);
            assert!(error <= rgb[0] / 511.0, "{rgb:?} misses by {error}");
        }
        assert_eq!(unpack(pack([f32::INFINITY, -1.0, f32::NAN])), [LARGEST, 0.0, 0.0]);
        // 511.5 rounds to 512, which takes the next exponent.
        assert_eq!(unpack(pack([511.6, 0.0, 0.0])), [512.0, 0.0, 0.0]);
    }
}
