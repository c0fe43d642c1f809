//! Statistics of the metallic-roughness material on its CPU twin: its value is that of glTF 2.0's appendix B where the two have to
//! agree, samples follow the pdf, and no light is made.
use crate::bsdf::{ALPHAS, Case, Counts, DEGREES, bsdf, energy, follow_the_pdf, join_what_cannot_be_told, samples};
use crate::scattering::{RINGS, SECTORS, d, g1, grids};
use glam::{DVec2, DVec3, Vec3, vec3};
use tallow::layout::BSDF_METALLIC;
use tallow::twins::bsdf::{Bsdf, bsdf_albedo, bsdf_evaluate, bsdf_is_delta, bsdf_sample};
use tallow::twins::metallic::{Metallic, Parameters};

const WHITE: Parameters = Parameters {
    base: Vec3::ONE,
    metallic: 0.0,
    f0: Vec3::splat(0.04),
    f90: 1.0,
    transmission: 0.0,
    alpha: 0.25,
    coat: [0.0; 2],
};

fn of(p: Parameters) -> Bsdf {
    Bsdf { metallic: Metallic::new(&p), ..bsdf(BSDF_METALLIC, p.alpha, true, 1.0) }
}

/// With a clear coat whose normal is tilted by 20 degrees.
fn tilted(p: Parameters) -> Bsdf {
    let mut b = of(p);
    b.metallic.coat_normal = vec3(0.2, 0.3, 0.94).normalize();
    b
}

/// Along `degrees` from the normal, away from the x axis, so that a wrong azimuth shows.
fn along(degrees: f32) -> Vec3 {
    let (s, c) = degrees.to_radians().sin_cos();
    vec3(0.8 * s, -0.6 * s, c)
}

fn cases() -> Vec<Case> {
    let base = vec3(0.9, 0.5, 0.1);
    let kinds = [
        ("metal", Parameters { metallic: 1.0, base, ..WHITE }),
        ("dielectric", Parameters { base, ..WHITE }),
        ("mixture", Parameters { metallic: 0.4, base, f0: vec3(0.08, 0.02, 0.0), f90: 0.7, ..WHITE }),
        ("thin wall", Parameters { transmission: 0.6, metallic: 0.1, base, ..WHITE }),
    ];
    let mut cases = Vec::new();
    for (alpha, degrees) in ALPHAS.iter().flat_map(|&a| DEGREES.map(|d| (a, d))) {
        for (name, p) in kinds {
            cases.push((
                format!("{name} alpha {alpha} {degrees} degrees"),
                of(Parameters { alpha, ..p }),
                along(degrees),
            ));
        }
    }
    for degrees in DEGREES {
        let lacquer = Parameters { coat: [0.8, 0.3], alpha: 0.5, base, ..WHITE };
        cases.push((format!("lacquer {degrees} degrees"), of(lacquer), along(degrees)));
        let smooth = Parameters { alpha: 0.0, coat: [1.0, 0.0], base, ..WHITE };
        cases.push((format!("smooth {degrees} degrees"), of(smooth), along(degrees)));
        // The viewer is above the horizon of the coat, too.
        if degrees < 80.0 {
            cases.push((format!("tilted lacquer {degrees} degrees"), tilted(lacquer), along(degrees)));
            cases.push((format!("tilted smooth lacquer {degrees} degrees"), tilted(smooth), along(degrees)));
        }
    }
    cases
}

/// Observed and expected counts, above the horizon and then beyond the wall; the last cell holds what is absorbed or a delta.
fn counts(b: &Bsdf, wo: Vec3, count: u32, seed: u32) -> Counts {
    let (grid, cells) = (&grids(b, wo)[0], RINGS * SECTORS);
    let mirrored = |w: Vec3, side: f32| vec3(w.x, w.y, w.z * side);
    let pdf = |side: f32| move |wi: Vec3| f64::from(bsdf_evaluate(b, wo, mirrored(wi, side)).w);
    let mut expected = [grid.integrate(pdf(1.0)), grid.integrate(pdf(-1.0))].concat();
    expected.iter_mut().for_each(|p| *p *= f64::from(count));
    expected.push((f64::from(count) - expected.iter().sum::<f64>()).max(0.0));
    let mut observed = vec![0.0; expected.len()];
    for (sampled, s) in samples(*b, wo, count, true, seed) {
        let beyond = if s.wi.z < 0.0 { cells } else { 0 };
        let up = mirrored(s.wi, s.wi.z.signum());
        observed[if sampled && !s.delta { beyond + grid.cell(up) } else { 2 * cells }] += 1.0;
    }
    join_what_cannot_be_told(&mut observed, &mut expected);
    (observed, expected)
}

#[test]
fn samples_follow_the_pdf() {
    follow_the_pdf(&cases(), counts);
}

#[test]
fn weight_is_value_over_pdf_and_reciprocal() {
    for (name, b, wo) in cases() {
        for (_, s) in samples(b, wo, 2048, false, 7).filter(|(sampled, s)| *sampled && !s.delta) {
            let value = bsdf_evaluate(&b, wo, s.wi);
            assert!((value.truncate() - s.weight * s.pdf).abs().max_element() <= 1e-4 * s.pdf, "{name}: {s:?}");
            // A tilted coat is not reciprocal: f is over the cosine at another normal.
            if s.wi.z.abs() < 1e-3 || b.metallic.coat_normal != Vec3::Z {
                continue;
            }
            // Both sides of a wall are alike: from behind, the same light comes back.
            let side = s.wi.z.signum();
            let (from, to) = (vec3(s.wi.x, s.wi.y, s.wi.z * side), vec3(wo.x, wo.y, wo.z * side));
            let (f, back) = (value.x / s.wi.z.abs(), bsdf_evaluate(&b, from, to).x / wo.z);
            assert!((f - back).abs() <= 0.03 * back + 1e-6, "{name}: {f} {back} {s:?}");
        }
    }
}

/// Specular reflection by appendix B: D V F with F at the half vector.
fn appendix_b(p: &Parameters, wo: DVec3, wi: DVec3) -> f64 {
    let m = (wo + wi).normalize();
    let alpha = f64::from(p.alpha);
    let vd = d(true, m, DVec2::splat(alpha)) * g1(true, wo.z, alpha) * g1(true, wi.z, alpha) / (4.0 * wo.z * wi.z);
    let schlick = |f0: f64, f90: f64| f0 + (f90 - f0) * (1.0 - wo.dot(m)).powi(5);
    let [base, metallic, f0, f90] = [p.base.x, p.metallic, p.f0.x * p.f90, p.f90].map(f64::from);
    let (metal, dielectric) = (vd * schlick(base, 1.0), vd * schlick(f0, f90));
    metallic * metal + (1.0 - metallic) * dielectric
}

#[test]
fn specular_reflection_is_that_of_appendix_b() {
    // Metal has no diffuse part; for the others it is told apart by a black base.
    let metal = Parameters { metallic: 1.0, base: Vec3::splat(0.6), ..WHITE };
    let dielectric = Parameters { base: Vec3::ZERO, f90: 0.8, ..WHITE };
    let both = Parameters { base: Vec3::ZERO, metallic: 0.5, ..WHITE };
    for p in [metal, dielectric, both].iter().flat_map(|p| ALPHAS.map(|alpha| Parameters { alpha, ..*p })) {
        let (b, wo) = (of(p), along(50.0));
        for (_, s) in samples(b, wo, 256, false, 5).filter(|(sampled, s)| *sampled && s.wi.z > 0.01) {
            let (found, z) = (f64::from(bsdf_evaluate(&b, wo, s.wi).x), f64::from(s.wi.z));
            let expected = appendix_b(&p, wo.as_dvec3(), s.wi.as_dvec3()) * z;
            assert!((found - expected).abs() <= 0.02 * expected + 1e-7, "{p:?}: {found} {expected}");
            let other = appendix_b(&Parameters { f0: Vec3::splat(0.08), ..p }, wo.as_dvec3(), s.wi.as_dvec3()) * z;
            assert!(p.metallic == 1.0 || expected < 1e-6 || (found - other).abs() > 0.02 * other, "control");
        }
    }
}

#[test]
fn no_light_is_made() {
    let kinds = [
        ("dielectric", WHITE),
        ("diamond", Parameters { f0: Vec3::splat(0.17), ..WHITE }),
        ("weak", Parameters { f90: 0.3, ..WHITE }),
        ("metal", Parameters { metallic: 1.0, ..WHITE }),
        ("mixture", Parameters { metallic: 0.5, ..WHITE }),
        ("wall", Parameters { transmission: 1.0, ..WHITE }),
        ("half a wall", Parameters { transmission: 0.5, ..WHITE }),
        ("lacquer", Parameters { coat: [1.0, 0.2], metallic: 1.0, ..WHITE }),
        ("lacquered wood", Parameters { coat: [1.0, 0.0], ..WHITE }),
    ];
    for coat in [0.0, 0.2, 1.0].map(|alpha| [1.0, alpha]) {
        for degrees in [0.0, 20.0, 40.0, 60.0] {
            let e = energy(tilted(Parameters { coat, ..WHITE }), along(degrees), 1 << 14);
            assert!(e > 0.3 && e < 1.004, "a tilted coat {coat:?} at {degrees} degrees: {e}");
        }
    }
    for ((name, p), alpha) in kinds.iter().flat_map(|k| [0.0, 0.05, 0.1, 0.25, 0.5, 1.0].map(|alpha| (k, alpha))) {
        for degrees in [0.0, 20.0, 40.0, 50.0, 60.0, 75.0, 86.0, 89.5] {
            let e = energy(of(Parameters { alpha, ..*p }), along(degrees), 1 << 14);
            assert!(e < 1.004, "{name} alpha {alpha} at {degrees} degrees: {e}");
            // The base gets what microfacets do not reflect, whatever they lose. Others lose nothing where smooth, and almost so where
            // nearly smooth, but at grazing angles. A coat keeps what it sends down twice.
            let (coated, based) = (p.coat[0] > 0.0, p.metallic + p.transmission == 0.0);
            let lossless = degrees < 45.0 && alpha <= 0.05 || alpha == 0.0;
            assert!(coated || !based || e > 0.996, "{name} alpha {alpha} at {degrees} degrees: {e}");
            assert!(coated || !lossless || e > 0.97, "{name} alpha {alpha} at {degrees} degrees: {e}");
            assert!(e > 0.05, "{name} alpha {alpha} at {degrees} degrees: {e}");
        }
    }
}

#[test]
fn albedo_is_near_the_share_that_comes_back() {
    for (degrees, alpha) in [0.0, 30.0, 60.0, 80.0, 88.0].iter().flat_map(|&d| [0.0, 0.05, 0.25, 1.0].map(|a| (d, a))) {
        let b = of(Parameters { base: Vec3::splat(0.6), alpha, ..WHITE });
        let (albedo, e) = (f64::from(bsdf_albedo(&b, along(degrees).z).x), energy(b, along(degrees), 1 << 14));
        assert!((albedo - e).abs() < 0.01, "{degrees} degrees, alpha {alpha}: {albedo} {e}");
    }
    let mirror = of(Parameters { alpha: 0.0, metallic: 1.0, ..WHITE });
    assert!(bsdf_is_delta(&mirror) && bsdf_albedo(&mirror, 0.5) == Vec3::ZERO);
}

#[test]
fn finite_for_every_input() {
    let numbers = [0.0, 0.3, 0.9, 1.0 - f32::EPSILON / 2.0];
    let shares = || [0.0, 0.5, 1.0].into_iter();
    let parameters =
        shares().flat_map(|metallic| shares().map(move |base| (metallic, base))).flat_map(|(metallic, base)| {
            shares().flat_map(move |transmission| {
                [0.0, 0.01, 0.3, 1.0].into_iter().flat_map(move |alpha| {
                    [[0.0, 0.0], [1.0, 0.0], [0.5, 0.3]].map(|coat| Parameters {
                        base: Vec3::splat(base),
                        metallic,
                        transmission,
                        alpha,
                        coat,
                        f90: base,
                        f0: Vec3::splat(0.04 + 0.96 * metallic),
                    })
                })
            })
        });
    for p in parameters {
        for cos in [0.0, 1e-30, 1e-7, 1e-4, 0.5, 1.0, -0.7] {
            let wo = vec3((1.0f32 - cos * cos).sqrt(), 0.0, cos);
            let b = if p.alpha == 0.3 { tilted(p) } else { of(p) };
            for u in numbers.iter().flat_map(|&x| numbers.map(|y| glam::vec2(x, y))) {
                let (sampled, s) = bsdf_sample(&b, wo, u.y, u);
                let fine = s.weight.is_finite() && s.weight.min_element() >= 0.0 && s.pdf.is_finite();
                assert!(!sampled || (fine && (s.wi.length() - 1.0).abs() < 1e-3), "{p:?} {wo} {u}: {s:?}");
                for wi in [s.wi, -wo, vec3(-wo.x, 0.0, wo.z), vec3(0.6, 0.0, -0.8), vec3(-1.0, 0.0, 1e-7)] {
                    let value = bsdf_evaluate(&b, wo, wi);
                    assert!(value.is_finite() && value.min_element() >= 0.0, "{p:?} {wo} {wi}: {value}");
                }
            }
        }
    }
}
