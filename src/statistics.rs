//! What is known of a pixel after some of its samples, and how two such records become one.
use crate::gpu::layout::{PixelLight, PixelStats, vec3};

/// One pixel of a render.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pixel {
    /// Radiance.
    pub stats: PixelStats,
    /// Direct and indirect light, zero where they are not kept apart.
    pub light: PixelLight,
}

/// The record of two disjoint sets of samples (Chan, Golub and LeVeque 1979): with d the difference of the means, the
/// mean moves by d n_b / n and M2 grows by d^2 n_a n_b / n. In double precision, rounded once: means within 2^-24 relative
/// of exact arithmetic on the records, M2 likewise.
///
/// # Panics
/// When they have 2^32 samples and more together.
pub fn join(a: &Pixel, b: &Pixel) -> Pixel {
    let (na, nb) = (f64::from(a.stats.count), f64::from(b.stats.count));
    let n = na + nb;
    if n == 0.0 {
        return *a;
    }
    let mean = |x: vec3, y: vec3| -> vec3 {
        std::array::from_fn(|i| (f64::from(x[i]) + (f64::from(y[i]) - f64::from(x[i])) * nb / n) as f32)
    };
    let m2 = std::array::from_fn(|i| {
        let d = f64::from(b.stats.mean[i]) - f64::from(a.stats.mean[i]);
        (f64::from(a.stats.m2[i]) + f64::from(b.stats.m2[i]) + d * d * na * nb / n) as f32
    });
    Pixel {
        stats: PixelStats {
            mean: mean(a.stats.mean, b.stats.mean),
            count: a.stats.count.checked_add(b.stats.count).expect("fewer than 2^32 samples"),
            m2,
            rays: a.stats.rays.wrapping_add(b.stats.rays),
        },
        light: PixelLight {
            direct: mean(a.light.direct, b.light.direct),
            indirect: mean(a.light.indirect, b.light.indirect),
        },
    }
}

/// Squared standard error of a pixel: m2 / (n (n - 1)); 0 for fewer than two samples, which tell nothing.
pub fn variance_of_mean(s: &PixelStats) -> vec3 {
    let n = s.count as f32;
    s.m2.map(|m2| if s.count > 1 { m2 / (n * (n - 1.0)) } else { 0.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(values: &[f64]) -> Pixel {
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let m2 = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>();
        let stats = PixelStats { mean: [mean as f32; 3], count: n as u32, m2: [m2 as f32; 3], rays: 0 };
        Pixel { stats, light: PixelLight { direct: stats.mean, indirect: [0.0; 3] } }
    }

    #[test]
    fn two_parts_are_the_whole() {
        // 1, 3, 5, 7: mean 4, M2 20, however they are parted; nothing joined to them changes nothing.
        for (a, b) in [(&[1.0][..], &[3.0, 5.0, 7.0][..]), (&[1.0, 3.0], &[5.0, 7.0]), (&[5.0, 1.0, 3.0], &[7.0])] {
            let whole = join(&of(a), &of(b)).stats;
            assert_eq!((whole.count, whole.mean, whole.m2), (4, [4.0; 3], [20.0; 3]));
        }
        let some = of(&[1.0, 2.0]);
        assert_eq!((join(&some, &Pixel::default()), join(&Pixel::default(), &some)), (some, some));
        assert_eq!(join(&Pixel::default(), &Pixel::default()), Pixel::default());
    }

    #[test]
    fn the_error_of_a_mean_needs_two_samples() {
        assert_eq!(variance_of_mean(&of(&[1.0, 2.0, 3.0, 6.0]).stats), [14.0 / 12.0; 3]);
        assert_eq!(variance_of_mean(&of(&[1.0]).stats), [0.0; 3]);
    }
}
