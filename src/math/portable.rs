//! Twin of `glsl/shared/portable_math.glsl`: the same bits.

/// e^-x for x >= 0, within 3e-7; 0 beyond 41 and for NaN.
pub fn exp_negative(x: f32) -> f32 {
    const COEFFICIENTS: [f32; 6] = [0.0018762329, 0.008992584, 0.055823606, 0.24015453, 0.69315296, 0.99999994];
    let y = x * -1.44269504;
    if y.is_nan() || y <= -60.0 {
        return 0.0;
    }
    let whole = y.floor();
    let p = COEFFICIENTS[1..].iter().fold(COEFFICIENTS[0], |p, c| p * (y - whole) + c);
    p * f32::from_bits(((whole as i32 + 127) as u32) << 23)
}

/// Squared distance of two points, with the same bits on every device.
pub fn squared_distance(a: [f32; 3], b: [f32; 3]) -> f32 {
    let [x, y, z] = [0, 1, 2].map(|i| a[i] - b[i]);
    x * x + y * y + z * z
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_the_exponential() {
        for i in 0..41_000 {
            let x = i as f32 * 1e-3;
            let error = f64::from(exp_negative(x)) / f64::from(-x).exp() - 1.0;
            // x / ln 2 is rounded to 24 bits, up to 60 * 2^-24 * ln 2 off.
            assert!(error.abs() < 3e-7 + 4e-6, "{x}: {error}");
        }
        assert_eq!([42.0, f32::INFINITY, f32::NAN, 1e30].map(exp_negative), [0.0; 4]);
        assert!(exp_negative(0.0) <= 1.0);
    }
}
