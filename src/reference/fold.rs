//! Twin of `glsl/fold.comp`: Welford's running mean and variance (1962), in order of sample index.
use crate::gpu::layout::{FoldPush, PixelLight, PixelStats, vec4};
use glam::{Vec3, Vec4};

/// A channel whose albedo is below this cannot be divided out.
const SMALLEST_ALBEDO: f32 = 1e-6;

/// What of a sample's light needs no filter, and its indirect irradiance over pi.
fn split(direct: Vec3, indirect: Vec3, albedo: Vec3) -> (Vec3, Vec3) {
    let divides = albedo.cmpgt(Vec3::splat(SMALLEST_ALBEDO));
    let irradiance = Vec3::select(divides, indirect / albedo.max(Vec3::splat(SMALLEST_ALBEDO)), Vec3::ZERO);
    (direct + Vec3::select(divides, Vec3::ZERO, indirect), irradiance)
}

/// Adds a batch to the statistics of all pixels. `samples`: sample k of pixel i at `k * push.pixels + i`, one vec4, or
/// with `split_light` three (direct, indirect, albedo), and in w of the first the sample's rays; `light` is left alone
/// without it.
pub fn fold(push: &FoldPush, split_light: bool, samples: &[vec4], stats: &mut [PixelStats], light: &mut [PixelLight]) {
    for i in 0..push.pixels as usize {
        let pixel = push.first_pixel as usize + i;
        for k in 0..push.samples as usize {
            let at = k * push.pixels as usize + i;
            if split_light {
                let [direct, indirect, albedo] = [0, 1, 2].map(|j| Vec4::from(samples[3 * at + j]).truncate());
                fold_radiance(&mut stats[pixel], direct + indirect, samples[3 * at][3]);
                let share = 1.0 / stats[pixel].count as f32;
                fold_light(&mut light[pixel], split(direct, indirect, albedo), share);
            } else {
                fold_radiance(&mut stats[pixel], Vec4::from(samples[at]).truncate(), samples[at][3]);
            }
        }
    }
}

fn fold_radiance(s: &mut PixelStats, radiance: Vec3, rays: f32) {
    s.count += 1;
    s.rays = s.rays.wrapping_add(rays as u32);
    let mean = Vec3::from(s.mean);
    let off = radiance - mean;
    let mean = mean + off * (1.0 / s.count as f32);
    s.mean = mean.into();
    s.m2 = (Vec3::from(s.m2) + off * (radiance - mean)).into();
}

fn fold_light(l: &mut PixelLight, (kept, irradiance): (Vec3, Vec3), share: f32) {
    let (direct, indirect) = (Vec3::from(l.direct), Vec3::from(l.indirect));
    l.direct = (direct + (kept - direct) * share).into();
    l.indirect = (indirect + (irradiance - indirect) * share).into();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_batches_solve_the_worked_example() {
        // 1, 2 then 3, 6: mean 3, squared deviations 4 + 1 + 0 + 9 = 14.
        let mut stats = [PixelStats::default()];
        let batch = FoldPush { pixels: 1, samples: 2, ..FoldPush::default() };
        fold(&batch, false, &[[1.0, 1.0, 1.0, 3.0], [2.0; 4]], &mut stats, &mut []);
        fold(&batch, false, &[[3.0; 4], [6.0; 4]], &mut stats, &mut []);
        assert_eq!((stats[0].count, stats[0].mean[1], stats[0].m2[2], stats[0].rays), (4, 3.0, 14.0, 14));
    }

    #[test]
    fn light_without_albedo_stays_direct() {
        let (kept, irradiance) = split(Vec3::ONE, Vec3::splat(2.0), glam::vec3(0.5, 0.0, 1.0));
        assert_eq!((kept, irradiance), (glam::vec3(1.0, 3.0, 1.0), glam::vec3(4.0, 0.0, 2.0)));
    }
}
