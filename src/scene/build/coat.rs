//! Computes the tables that kernels read for rough coats: the light that a coat does not let in, and what it reflects inwards;
//! and, for metallic materials, what their microfacets reflect.
use super::fresnel;
use crate::layout::SMOOTH_ALPHA;
use crate::layout::{BSDF_COATED, BSDF_METALLIC, COAT_COLUMNS, COAT_ROWS, MATERIAL_GGX, Material};
use crate::math::fresnel::fresnel_dielectric;
use crate::math::microfacet::{VisibleNormals, microfacet_area, microfacet_g1};
use glam::{Vec3, vec3};
use rayon::prelude::*;
use std::collections::HashMap;
use std::sync::LazyLock;

const ROWS: usize = COAT_ROWS as usize;
const COLUMNS: usize = COAT_COLUMNS as usize;
/// The square root of the cosine from one column to the next.
const STEP: f32 = 1.0 / (COLUMNS - 2) as f32;
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

/// Whether kernels read a table for the material.
pub fn reads_table(m: &Material) -> bool {
    let rough = |alpha: f32| alpha >= SMOOTH_ALPHA;
    match m.kind {
        BSDF_COATED => rough(m.alpha),
        BSDF_METALLIC => rough(m.alpha) || rough(m.clearcoat_alpha),
        _ => false,
    }
}

/// Adds what rough coats and microfacets reflect to the words of the textures: a table for each index and distribution, and one
/// for all metallic materials.
pub fn add_tables(materials: &mut [Material], texels: &mut Vec<u32>) {
    let mut tables = HashMap::new();
    for m in materials.iter_mut().filter(|m| reads_table(m)) {
        let coat = (m.kind == BSDF_COATED).then_some((m.eta[0].to_bits(), m.flags & MATERIAL_GGX != 0));
        m.coat_table = *tables.entry(coat).or_insert_with(|| {
            let first = texels.len() as u32;
            match coat {
                Some((_, ggx)) => texels.extend(coat_table(m.eta[0], ggx).into_iter().map(f32::to_bits)),
                None => texels.extend_from_slice(microfacet_table()),
            }
            first
        });
    }
}

/// Rows and columns as of [`coat_table`], for GGX microfacets whose reflectance is Schlick's: in the low 16 bits the share of light
/// that they reflect above the horizon where F is 1 head on and 0 at grazing angles, in the high 16 where it is 0 and 1, in units of
/// 1 / 65535. The last column has the means over a diffuse hemisphere.
pub fn microfacet_table() -> &'static [u32] {
    static TABLE: LazyLock<Vec<u32>> =
        LazyLock::new(|| (0..ROWS).into_par_iter().flat_map_iter(|row| microfacet_row(alpha_of(row))).collect());
    &TABLE
}

fn microfacet_row(alpha: f32) -> [u32; COLUMNS] {
    let shares: Vec<[f32; 2]> = (0..COLUMNS - 1).map(|i| reflected(alpha, cosine_of(i))).collect();
    let mean = [0, 1].map(|k| hemisphere(|i| shares[i][k]));
    let pack = |[head_on, grazing]: [f32; 2]| [head_on, grazing].map(|s| (s * 65535.0).round() as u32);
    let words = shares.into_iter().chain([mean]).map(pack).map(|[low, high]| low | high << 16);
    words.collect::<Vec<_>>().try_into().expect("a row")
}

/// [`CoatRow`]s at roughnesses from 0.01 to 1, each the same multiple of the one before, for a coat of relative index `eta` over
/// GGX microfacets, or Beckmann's. Light is let in or reflected by one scattering, as in Mitsuba 3's `roughplastic`; what
/// would need more is lost.
pub fn coat_table(eta: f32, ggx: bool) -> Vec<f32> {
    (0..ROWS).into_par_iter().flat_map_iter(|row| coat_row(eta, ggx, alpha_of(row))).collect()
}

fn alpha_of(row: usize) -> f32 {
    SMOOTH_ALPHA.powf(1.0 - row as f32 / (ROWS - 1) as f32)
}

fn cosine_of(column: usize) -> f32 {
    (STEP * column as f32).min(1.0).powi(2)
}

/// The mean over a diffuse hemisphere of a function of the column: that over c = s^2 with density 2 c is that of 4 s^3, by the
/// trapezoidal rule.
fn hemisphere(at: impl Fn(usize) -> f32) -> f32 {
    let weight = |i: usize| (STEP * i as f32).powi(3) * STEP * if i == COLUMNS - 2 { 2.0 } else { 4.0 };
    let weights = (0..COLUMNS - 1).map(weight);
    weights.clone().enumerate().map(|(i, w)| w * at(i)).sum::<f32>() / weights.sum::<f32>()
}

fn coat_row(eta: f32, ggx: bool, alpha: f32) -> CoatRow {
    let mut row: CoatRow =
        std::array::from_fn(|i| if i < COLUMNS - 1 { 1.0 - scattered(eta, ggx, alpha, cosine_of(i))[1] } else { 0.0 });
    let cosines = (0..POINTS).map(|i| (i as f32 + 0.5) / POINTS as f32);
    let inside = cosines.map(|c| 2.0 * c * scattered(1.0 / eta, ggx, alpha, c)[0]).sum::<f32>() / POINTS as f32;
    // By reciprocity 1 / eta^2 of what enters can leave: no more, although columns are wide around an angle of total reflection.
    row[COLUMNS - 1] = inside.min(1.0 - hemisphere(|i| 1.0 - row[i]) / (eta * eta));
    row
}

/// The shares of light along a direction of cosine `c` >= 0 that one scattering by a rough interface reflects above the
/// horizon and refracts below it: the lobes of `glsl/shared/bsdf.glsl`, averaged over visible normals.
fn scattered(eta: f32, ggx: bool, alpha: f32, c: f32) -> [f32; 2] {
    over_visible_normals(ggx, alpha, c, |wo, m| {
        let co = wo.dot(m);
        let (f, lit) =
            (fresnel_dielectric(co, eta), |z: f32, w: Vec3| if z > 0.0 { microfacet_g1(ggx, w, alpha) } else { 0.0 });
        let (reflected, refracted) = (2.0 * co * m - wo, wo / eta - (co / eta - f.y) * m);
        [f.x * lit(reflected.z, reflected), (1.0 - f.x) * lit(refracted.z, refracted)]
    })
}

/// The shares that GGX microfacets reflect above the horizon, of Schlick's reflectance 1 head on alone and 1 at grazing angles alone.
fn reflected(alpha: f32, c: f32) -> [f32; 2] {
    over_visible_normals(true, alpha, c, |wo, m| {
        let co = wo.dot(m);
        let wi = 2.0 * co * m - wo;
        let lit = if wi.z > 0.0 { microfacet_g1(true, wi, alpha) } else { 0.0 };
        let grazing = (1.0 - co).clamp(0.0, 1.0).powi(5);
        [lit * (1.0 - grazing), lit * grazing]
    })
}

/// The means of `of_normal(wo, m)` over the normals m visible along a direction of cosine `c` >= 0, masked as the kernels do it.
fn over_visible_normals(ggx: bool, alpha: f32, c: f32, of_normal: impl Fn(Vec3, Vec3) -> [f32; 2]) -> [f32; 2] {
    let c = c.max(LEAST_COSINE);
    let wo = vec3((1.0 - c * c).max(0.0).sqrt(), 0.0, c);
    let masking = microfacet_g1(ggx, wo, alpha) * microfacet_area(ggx, wo, alpha) / c;
    // Steps in u = v^2 (3 - 2 v), which vanish at both ends: there normals run off into the tails of the distribution.
    let [u, width] = [|v: f32| v * v * (3.0 - 2.0 * v), |v: f32| 6.0 * v * (1.0 - v)];
    let steps: [f32; POINTS] = std::array::from_fn(|i| (i as f32 + 0.5) / POINTS as f32);
    let normals = VisibleNormals::new(ggx, wo, alpha);
    let firsts = steps.map(|x| normals.first(u(x)));
    let (mut sum, mut all) = ([0.0; 2], 0.0);
    for y in steps {
        let second = normals.second(u(y));
        for (x, first) in steps.into_iter().zip(firsts) {
            let weight = f64::from(width(x) * width(y));
            let shares = of_normal(wo, normals.at(first, second));
            sum = [0, 1].map(|i| sum[i] + weight * f64::from(shares[i] * masking));
            all += weight;
        }
    }
    sum.map(|s| (s / all).min(1.0) as f32)
}
