//! Computes the tables that kernels read for rough coats: the light that a coat does not let in, and what it reflects inwards.
use super::fresnel;
use crate::layout::SMOOTH_ALPHA;
use crate::layout::{BSDF_COATED, COAT_COLUMNS, COAT_ROWS, MATERIAL_GGX, Material};
use crate::math::fresnel::fresnel_dielectric;
use crate::math::microfacet::{microfacet_area, microfacet_g1, microfacet_sample};
use glam::{Vec3, vec2, vec3};
use rayon::prelude::*;
use std::collections::HashMap;

const ROWS: usize = COAT_ROWS as usize;
const COLUMNS: usize = COAT_COLUMNS as usize;
/// Cosines are at least this: the reflectance has a limit at the horizon, but its formulas divide by the cosine.
const LEAST_COSINE: f32 = 1e-4;
/// Points per axis among microfacet normals, and cosines for the mean from inside.
const POINTS: usize = 24;

/// For a coat of one roughness, the share of light that it does not let in, at cosines that are the squares of equal steps
/// from 0 to 1; last, its mean reflectance for diffuse light from inside.
pub type CoatRow = [f32; COLUMNS];

/// Sets what smooth coats reflect of diffuse light from inside.
pub fn add_means(materials: &mut [Material]) {
    for m in materials.iter_mut().filter(|m| m.kind == BSDF_COATED) {
        m.internal_fresnel = fresnel::mean_internal(m.eta[0]);
    }
}

/// Adds what rough coats reflect to the words of the textures: a table for each index and distribution.
pub fn add_tables(materials: &mut [Material], texels: &mut Vec<u32>) {
    let mut tables = HashMap::new();
    for m in materials.iter_mut().filter(|m| m.kind == BSDF_COATED && m.alpha >= SMOOTH_ALPHA) {
        let ggx = m.flags & MATERIAL_GGX != 0;
        m.coat_table = *tables.entry((m.eta[0].to_bits(), ggx)).or_insert_with(|| {
            let first = texels.len() as u32;
            texels.extend(coat_table(m.eta[0], ggx).into_iter().map(f32::to_bits));
            first
        });
    }
}

/// [`CoatRow`]s at roughnesses from 0.01 to 1, each the same multiple of the one before, for a coat of relative index `eta` over
/// GGX microfacets, or Beckmann's. Light is let in or reflected by one scattering, as in Mitsuba 3's `roughplastic`; what
/// would need more is lost.
pub fn coat_table(eta: f32, ggx: bool) -> Vec<f32> {
    let alpha = |row: usize| SMOOTH_ALPHA.powf(1.0 - row as f32 / (ROWS - 1) as f32);
    (0..ROWS).into_par_iter().flat_map_iter(|row| coat_row(eta, ggx, alpha(row))).collect()
}

fn coat_row(eta: f32, ggx: bool, alpha: f32) -> CoatRow {
    let step = 1.0 / (COLUMNS - 2) as f32;
    let mut row: CoatRow = std::array::from_fn(|i| {
        let root = (step * i as f32).min(1.0);
        1.0 - scattered(eta, ggx, alpha, root * root)[1]
    });
    let cosines = (0..POINTS).map(|i| (i as f32 + 0.5) / POINTS as f32);
    let inside = cosines.map(|c| 2.0 * c * scattered(1.0 / eta, ggx, alpha, c)[0]).sum::<f32>() / POINTS as f32;
    // By reciprocity 1 / eta^2 of what enters can leave: no more, although columns are wide around an angle of total
    // reflection. The mean of 1 - row over c = s^2 is that of 4 s^3 (1 - row), by the trapezoidal rule.
    let weight = |i: usize| (step * i as f32).powi(3) * step * if i == COLUMNS - 2 { 2.0 } else { 4.0 };
    let enters: f32 = (0..COLUMNS - 1).map(|i| weight(i) * (1.0 - row[i])).sum();
    row[COLUMNS - 1] = inside.min(1.0 - enters / (eta * eta));
    row
}

/// The shares of light along a direction of cosine `c` >= 0 that one scattering by a rough interface reflects above the
/// horizon and refracts below it: the lobes of `glsl/shared/bsdf.glsl`, averaged over visible normals.
fn scattered(eta: f32, ggx: bool, alpha: f32, c: f32) -> [f32; 2] {
    let c = c.max(LEAST_COSINE);
    let wo = vec3((1.0 - c * c).max(0.0).sqrt(), 0.0, c);
    let masking = microfacet_g1(ggx, wo, alpha) * microfacet_area(ggx, wo, alpha) / c;
    let of_normal = |m: Vec3| {
        let co = wo.dot(m);
        let (f, lit) =
            (fresnel_dielectric(co, eta), |z: f32, w: Vec3| if z > 0.0 { microfacet_g1(ggx, w, alpha) } else { 0.0 });
        let (reflected, refracted) = (2.0 * co * m - wo, wo / eta - (co / eta - f.y) * m);
        [f.x * lit(reflected.z, reflected), (1.0 - f.x) * lit(refracted.z, refracted)]
            .map(|share| f64::from(share * masking))
    };
    // Steps in u = v^2 (3 - 2 v), which vanish at both ends: there normals run off into the tails of the distribution.
    let [u, width] = [|v: f32| v * v * (3.0 - 2.0 * v), |v: f32| 6.0 * v * (1.0 - v)];
    let at = |i: usize| (i as f32 + 0.5) / POINTS as f32;
    let (mut sum, mut all) = ([0.0; 2], 0.0);
    for (x, y) in (0..POINTS * POINTS).map(|i| (at(i % POINTS), at(i / POINTS))) {
        let weight = f64::from(width(x) * width(y));
        let shares = of_normal(microfacet_sample(ggx, wo, alpha, vec2(u(x), u(y))));
        sum = [0, 1].map(|i| sum[i] + weight * shares[i]);
        all += weight;
    }
    sum.map(|s| (s / all).min(1.0) as f32)
}
