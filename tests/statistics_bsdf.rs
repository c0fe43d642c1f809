//! Statistics of the BSDFs on their CPU twins: what is sampled follows the pdf, the weight is f cos / pdf, light is
//! neither made nor lost but where theory says so.
#[path = "support/scattering.rs"]
mod scattering;
#[path = "support/statistics.rs"]
mod statistics;

use glam::{Vec2, Vec3, vec3};
use rayon::prelude::*;
use scattering::{RINGS, SECTORS, d, g1, grids, scattered_once};
use statistics::{chi_square, sidak};
use tallow::gpu::layout::{BSDF_COATED, BSDF_CONDUCTOR, BSDF_DIELECTRIC, BSDF_DIFFUSE};
use tallow::reference::bsdf::{Bsdf, BsdfSample, bsdf_evaluate, bsdf_is_delta, bsdf_sample};
use tallow::reference::fresnel::internal_fresnel;
use tallow::reference::sampler::{sample_2d, sampler_start};

const ALPHAS: [f32; 5] = [0.01, 0.05, 0.2, 0.5, 1.0];
const DEGREES: [f32; 5] = [0.0, 35.0, 60.0, 86.0, 89.5];

fn bsdf(kind: u32, alpha: f32, ggx: bool, eta: f32) -> Bsdf {
    Bsdf {
        kind,
        albedo: Vec3::ONE,
        alpha,
        eta: Vec3::splat(eta),
        k: Vec3::ZERO,
        specular: Vec3::ONE,
        transmission: Vec3::ONE,
        internal_fresnel: internal_fresnel(f64::from(eta)) as f32,
        ggx,
    }
}

/// Reflects everything: extinction beyond any metal.
fn conductor(alpha: f32, ggx: bool) -> Bsdf {
    Bsdf { k: Vec3::splat(1e4), ..bsdf(BSDF_CONDUCTOR, alpha, ggx, 1.0) }
}

/// A coat that reflects one colour best, over a dark base of another: the odds of its lobes depend on both.
fn tinted(alpha: f32, ggx: bool) -> Bsdf {
    let (albedo, specular) = (vec3(0.25, 0.04, 0.1), vec3(0.9, 0.3, 0.5));
    Bsdf { albedo, specular, ..bsdf(BSDF_COATED, alpha, ggx, 1.5) }
}

/// Smooth coats, and tinted ones.
fn coats() -> Vec<(String, Bsdf, Vec3)> {
    let coats = [
        ("smooth coat", bsdf(BSDF_COATED, 0.0, false, 1.5)),
        ("tinted smooth coat", tinted(0.0, false)),
        ("tinted Beckmann coat", tinted(0.05, false)),
        ("tinted GGX coat", tinted(0.5, true)),
    ];
    let cases = coats.map(|(name, b)| {
        DEGREES.map(|degrees| {
            let (s, c) = degrees.to_radians().sin_cos();
            (format!("{name} {degrees} degrees"), b, vec3(0.8 * s, -0.6 * s, c))
        })
    });
    cases.concat()
}

/// Every rough kind, glass from both sides, and a bubble (index below 1); `inside` means wo.z < 0.
fn rough_cases() -> Vec<(String, Bsdf, Vec3)> {
    let mut cases = Vec::new();
    for (alpha, ggx, degrees) in
        ALPHAS.iter().flat_map(|&a| [false, true].map(|g| (a, g))).flat_map(|(a, g)| DEGREES.map(|d| (a, g, d)))
    {
        let (s, c) = degrees.to_radians().sin_cos();
        // Away from the x axis, so that a wrong azimuth shows.
        let wo = vec3(0.8 * s, -0.6 * s, c);
        let inside = wo * vec3(1.0, 1.0, -1.0);
        let glass = bsdf(BSDF_DIELECTRIC, alpha, ggx, 1.5);
        for (name, b, wo) in [
            ("conductor", conductor(alpha, ggx), wo),
            ("glass", glass, wo),
            ("glass from inside", glass, inside),
            ("bubble", bsdf(BSDF_DIELECTRIC, alpha, ggx, 0.75), wo),
            ("coated", bsdf(BSDF_COATED, alpha, ggx, 1.5), wo),
        ] {
            cases.push((
                format!("{name} alpha {alpha} {} {degrees} degrees", if ggx { "GGX" } else { "Beckmann" }),
                b,
                wo,
            ));
        }
    }
    cases
}

/// `count` samples of `b`; points of one Sobol sequence or independent numbers.
fn samples(b: Bsdf, wo: Vec3, count: u32, independent: bool, seed: u32) -> impl Iterator<Item = (bool, BsdfSample)> {
    (0..count).map(move |i| {
        let s = sampler_start(0, i, seed, independent);
        bsdf_sample(&b, wo, sample_2d(s, 0).x, sample_2d(s, 1))
    })
}

/// Quadrature errs by up to 8e-4 of all samples (a diffuse base in the slopes of a narrow coat): a last cell that
/// expects no more joins the largest.
fn join_what_cannot_be_told(observed: &mut Vec<f64>, expected: &mut Vec<f64>) {
    if expected[expected.len() - 1] < 1e-3 * expected.iter().sum::<f64>() {
        let largest = (0..expected.len()).max_by(|&a, &b| expected[a].total_cmp(&expected[b])).unwrap();
        expected[largest] += expected.pop().unwrap();
        observed[largest] += observed.pop().unwrap();
    }
}

/// Observed and expected counts; the last cell holds what is absorbed or a delta.
fn counts(b: &Bsdf, wo: Vec3, count: u32, seed: u32) -> (Vec<f64>, Vec<f64>) {
    let grids = grids(b, wo);
    let cells = RINGS * SECTORS;
    let pdf = |wi: Vec3| f64::from(bsdf_evaluate(b, wo, wi).w);
    let mut expected: Vec<f64> = grids.iter().flat_map(|g| g.integrate(pdf)).map(|p| p * f64::from(count)).collect();
    expected.push((f64::from(count) - expected.iter().sum::<f64>()).max(0.0));
    let mut observed = vec![0.0; expected.len()];
    for (sampled, s) in samples(*b, wo, count, true, seed) {
        let refracted = usize::from(s.wi.z * wo.z < 0.0);
        let cell =
            if sampled && !s.delta { refracted * cells + grids[refracted].cell(s.wi) } else { grids.len() * cells };
        observed[cell] += 1.0;
    }
    join_what_cannot_be_told(&mut observed, &mut expected);
    (observed, expected)
}

#[test]
fn samples_follow_the_pdf() {
    let mut cases = rough_cases();
    for degrees in DEGREES {
        let (s, c) = degrees.to_radians().sin_cos();
        cases.push((format!("diffuse {degrees}"), bsdf(BSDF_DIFFUSE, 0.0, false, 1.5), vec3(s, 0.0, c)));
    }
    cases.extend(coats());
    let level = sidak(cases.len());
    let judge = |(seed, (name, b, wo)): (usize, &(String, Bsdf, Vec3))| {
        let (observed, expected) = counts(b, *wo, 200_000, seed as u32);
        // Control: 5 % more density everywhere.
        let planted: Vec<f64> = expected.iter().map(|e| 1.05 * e).collect();
        assert!(chi_square(&observed, &planted) < level, "{name}: the test cannot see a pdf that is 5 % off");
        let p = chi_square(&observed, &expected);
        (p < level).then(|| format!("{name}: p = {p:.1e}"))
    };
    let failures: Vec<_> = cases.par_iter().enumerate().filter_map(judge).collect();
    assert!(
        failures.is_empty(),
        "{} of {} rejected at level {level:.1e}:\n{}",
        failures.len(),
        cases.len(),
        failures.join("\n")
    );
}

#[test]
fn weight_is_value_over_pdf() {
    for (name, b, wo) in rough_cases().into_iter().chain(coats()) {
        let mut checked = 0;
        for (sampled, s) in samples(b, wo, 4096, false, 7) {
            let value = bsdf_evaluate(&b, wo, s.wi);
            if !sampled || s.delta || value.w <= 0.0 {
                continue;
            }
            checked += 1;
            let ratio = value.truncate() / value.w;
            let near = |ratio: Vec3| (ratio - s.weight).abs().cmple(2e-3 * s.weight).all();
            assert!(near(ratio), "{name}: {ratio} {s:?}");
            // The half vector of a grazing pair loses digits, which a narrow lobe magnifies.
            assert!((value.w - s.pdf).abs() <= 0.05 * s.pdf, "{name}: pdf {} {s:?}", value.w);
            assert!(!near(1.02 * ratio), "control");
        }
        assert!(checked > 40, "{name}: only {checked} samples");
    }
}

#[test]
fn reciprocal() {
    for (name, b, wo) in rough_cases().into_iter().chain(coats()) {
        for (sampled, s) in samples(b, wo, 64, false, 3) {
            if !sampled || s.wi.z.abs() < 1e-3 {
                continue;
            }
            let f = bsdf_evaluate(&b, wo, s.wi).x / s.wi.z.abs();
            let back = bsdf_evaluate(&b, s.wi, wo).x / wo.z.abs();
            // n_i^2 f(wo, wi) = n_o^2 f(wi, wo), so that radiance over n^2 is kept.
            let refracted = s.wi.z * wo.z < 0.0;
            let n2 = if !refracted { 1.0 } else { b.eta.x.powf(if wo.z > 0.0 { 2.0 } else { -2.0 }) };
            assert!((n2 * f - back).abs() <= 0.03 * back + 1e-6, "{name}: {f} {back} {s:?}");
            // Control: forgetting the indices.
            assert!(!refracted || back < 1e-3 || (f - back).abs() > 0.03 * back, "{name}: control {f} {back}");
        }
    }
}

/// Flux that leaves for one unit that arrives along wo (by reciprocity): refracted radiance times eta^2.
fn energy(b: Bsdf, wo: Vec3, count: u32) -> f64 {
    let eta = if wo.z < 0.0 { 1.0 / b.eta.x } else { b.eta.x };
    let flux = |s: &BsdfSample| f64::from(s.weight.x * if s.wi.z * wo.z < 0.0 { eta * eta } else { 1.0 });
    samples(b, wo, count, false, 11).filter(|(sampled, _)| *sampled).map(|(_, s)| flux(&s)).sum::<f64>()
        / f64::from(count)
}

#[test]
fn smooth_kinds_conserve_energy() {
    for degrees in DEGREES {
        let (s, c) = degrees.to_radians().sin_cos();
        let wo = vec3(s, 0.0, c);
        for b in [
            bsdf(BSDF_DIELECTRIC, 0.0, false, 1.5),
            bsdf(BSDF_COATED, 0.0, false, 1.5),
            conductor(0.0, false),
            bsdf(BSDF_DIFFUSE, 0.0, false, 1.5),
        ] {
            assert!(bsdf_is_delta(&b) == matches!(b.kind, BSDF_CONDUCTOR | BSDF_DIELECTRIC));
            let e = energy(b, wo, 1 << 15);
            assert!((e - 1.0).abs() < 1e-3, "kind {} at {degrees} degrees: {e}", b.kind);
            let planted =
                Bsdf { albedo: Vec3::splat(0.99), specular: Vec3::splat(0.99), transmission: Vec3::splat(0.99), ..b };
            assert!((energy(planted, wo, 1 << 15) - 1.0).abs() > 1e-3, "control");
        }
    }
}

#[test]
fn a_rough_mirror_loses_what_single_scattering_loses() {
    for (alpha, ggx) in ALPHAS.iter().flat_map(|&a| [(a, false), (a, true)]) {
        for degrees in DEGREES {
            let (s, c) = degrees.to_radians().sin_cos();
            let wo = vec3(s, 0.0, c);
            let (b, a) = (conductor(alpha, ggx), f64::from(alpha));
            let torrance_sparrow = |wi: Vec3| {
                let (wo, wi) = (wo.as_dvec3(), wi.as_dvec3());
                d(ggx, (wo + wi).normalize(), a) * g1(ggx, wo.z, a) * g1(ggx, wi.z, a) / (4.0 * wo.z)
            };
            let exact: f64 = grids(&b, wo)[0].integrate(torrance_sparrow).iter().sum();
            let e = energy(b, wo, 1 << 14);
            assert!((e - exact).abs() < 2e-3, "alpha {alpha} ggx {ggx} at {degrees}: {e}, by quadrature {exact}");
            // Walter's fit of the Beckmann G1 lies up to 0.4 % above the exact one.
            assert!(e < 1.005, "alpha {alpha} at {degrees}: {e}");
        }
    }
}

#[test]
fn rough_glass_and_coats_lose_what_single_scattering_loses() {
    let cases: Vec<_> = rough_cases().into_iter().filter(|(_, b, _)| b.kind != BSDF_CONDUCTOR).collect();
    let judge = |(name, b, wo): &(String, Bsdf, Vec3)| {
        let exact: f64 = scattered_once(b, *wo).iter().sum();
        let e = energy(*b, *wo, 1 << 16);
        let off = |e: f64| (e - exact).abs() > 2e-3;
        // Walter's fit adds up to 0.4 %; a coat whose base passes a smooth interface stays within the same margin.
        let wrong = off(e) || e > 1.006 || !off(0.97 * e);
        wrong.then(|| format!("{name}: {e}, by quadrature {exact}"))
    };
    let failures: Vec<_> = cases.par_iter().filter_map(judge).collect();
    assert!(failures.is_empty(), "or a loss of 3 % more is not seen:\n{}", failures.join("\n"));
}

#[test]
fn finite_for_every_input() {
    let numbers = [0.0, 0.3, 0.5, 0.9, 1.0 - f32::EPSILON / 2.0];
    for (kind, alpha) in (BSDF_DIFFUSE..=BSDF_COATED).flat_map(|k| [0.0, 0.01, 0.3, 1.0].map(|a| (k, a))) {
        for (eta, k) in [0.4, 0.999, 1.0, 1.0003, 1.5, 4.0].iter().flat_map(|&e| [0.0, 0.3, 7.0].map(|k| (e, k))) {
            for (cos, ggx) in
                [0.0, 1e-30, 1e-8, 1e-7, 1e-4, 0.5, 1.0, -1e-7, -0.7].iter().flat_map(|&c| [(c, false), (c, true)])
            {
                let b = Bsdf { k: Vec3::splat(k), ..bsdf(kind, alpha, ggx, eta) };
                let wo = vec3((1.0f32 - cos * cos).sqrt(), 0.0, cos);
                for u in numbers.iter().flat_map(|&x| numbers.map(|y| Vec2::new(x, y))) {
                    let (sampled, s) = bsdf_sample(&b, wo, u.y, u);
                    let all = [s.weight.x, s.pdf, s.wi.x, s.wi.y, s.wi.z];
                    assert!(!sampled || all.iter().all(|v| v.is_finite()), "{b:?} {wo} {u}: {s:?}");
                    assert!(
                        !sampled || (s.weight.min_element() >= 0.0 && (s.wi.length() - 1.0).abs() < 1e-3),
                        "{b:?} {wo} {u}: {s:?}"
                    );
                    for wi in [s.wi, -wo, vec3(-wo.x, 0.0, wo.z), vec3(0.6, 0.0, -0.8), vec3(-1.0, 0.0, 1e-7)] {
                        let value = bsdf_evaluate(&b, wo, wi);
                        assert!(value.is_finite() && value.min_element() >= 0.0, "{b:?} {wo} {wi}: {value}");
                    }
                }
            }
        }
    }
}
