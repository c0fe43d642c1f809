//! Optical constants: metals by name, indices from a reflectance.
use crate::error::Checked;

/// Names, then index of refraction and extinction for linear Rec. 709 red, green, blue.
type Metal = (&'static [&'static str], [f32; 3], [f32; 3]);

/// Spectral measurements integrated against the CIE 1931 observer and converted to Rec. 709, the table that the
/// Tungsten renderer (Bitterli 2014) ships and other renderers have taken over.
const METALS: &[Metal] = &[
    (&["silver", "ag"], [0.155_264_65, 0.116_723_3, 0.138_380_7], [4.828_343_4, 3.122_246, 2.146_950_5]),
    (&["aluminium", "aluminum", "al"], [1.657_46, 0.880_368_95, 0.521_228_73], [9.223_869, 6.269_523, 4.837_001]),
    (&["gold", "au"], [0.143_118_95, 0.374_957_04, 1.442_478_5], [3.983_160_5, 2.385_720_7, 1.603_215_3]),
    (&["chromium", "cr"], [4.369_683, 2.916_702_5, 1.654_700_5], [5.206_434, 4.231_364_7, 3.754_946_7]),
    (&["copper", "cu"], [0.200_437_7, 0.924_033_46, 1.102_212], [3.912_948_6, 2.452_847_7, 2.142_188]),
];

/// Index of refraction and extinction of a metal.
///
/// # Errors
/// A sentence with the names that are known.
pub fn metal(name: &str) -> Checked<([f32; 3], [f32; 3])> {
    let lower = name.to_lowercase();
    match METALS.iter().find(|(names, ..)| names.contains(&lower.as_str())) {
        Some(&(_, eta, k)) => Ok((eta, k)),
        None => {
            let known: Vec<_> = METALS.iter().map(|m| m.0[0]).collect();
            Err(format!("metal \"{name}\" is not known: choose {}, or give eta and k", known.join(", ")))
        }
    }
}

/// One channel's (eta, k) with reflectance `r` at normal incidence and full edge tint (Gulbrandsen 2014, "Artist
/// Friendly Metallic Fresnel", with edge tint 1, where his formulas reduce to these). r = 1 gives (0, 1), whose
/// Fresnel reflectance is 1 at every angle: the mirror.
pub fn metal_from_reflectance(r: f32) -> (f32, f32) {
    let r = r.clamp(0.0, 1.0);
    ((1.0 - r) / (1.0 + r), 2.0 * r.sqrt() / (1.0 + r))
}

/// Reflectance at normal incidence of a dielectric of relative index `eta`.
pub fn normal_reflectance(eta: f32) -> f32 {
    ((eta - 1.0) / (eta + 1.0)).powi(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Exact unpolarised reflectance of a conductor (Born and Wolf), for the checks below.
    fn conductor(cos: f64, eta: f64, k: f64) -> f64 {
        let (sin2, cos2) = (1.0 - cos * cos, cos * cos);
        let t0 = eta * eta - k * k - sin2;
        let ab = (t0 * t0 + 4.0 * eta * eta * k * k).sqrt();
        let a = ((ab + t0) / 2.0).max(0.0).sqrt();
        let rs = (ab + cos2 - 2.0 * a * cos) / (ab + cos2 + 2.0 * a * cos);
        let (t3, t4) = (cos2 * ab + sin2 * sin2, 2.0 * a * cos * sin2);
        (rs + rs * (t3 - t4) / (t3 + t4)) / 2.0
    }

    #[test]
    fn the_mirror_reflects_everything_at_every_angle() {
        for cos in [0.01, 0.3, 0.7, 1.0] {
            assert_eq!(conductor(cos, 0.0, 1.0), 1.0);
            assert!(conductor(cos, 0.1, 1.0) < 1.0, "control: a lossy index does not");
        }
    }

    #[test]
    fn reflectance_gives_its_own_index_back() {
        for r in [0.0, 0.2, 0.5, 0.95, 1.0] {
            let (eta, k) = metal_from_reflectance(r);
            assert!((conductor(1.0, eta.into(), k.into()) - f64::from(r)).abs() < 1e-6, "{r}");
        }
    }

    /// By name: what the constants that Tungsten ships give, and what Lagarde ("Feeding a physically based shading model", 2011) lists
    /// from other measurements, which differ most for chromium. Both are linear Rec. 709.
    const REFLECTANCES: [(&str, [f64; 3], [f64; 3], f64); 5] = [
        ("silver", [0.9748, 0.9575, 0.9063], [0.9715, 0.9599, 0.9153], 0.04),
        ("aluminium", [0.9280, 0.9178, 0.9189], [0.9132, 0.9215, 0.9245], 0.04),
        ("gold", [0.9667, 0.8022, 0.3240], [1.0, 0.7656, 0.3361], 0.04),
        ("chromium", [0.6875, 0.6491, 0.6870], [0.5496, 0.5561, 0.5543], 0.15),
        ("copper", [0.9521, 0.6197, 0.5106], [0.9550, 0.6374, 0.5382], 0.04),
    ];

    #[test]
    fn metals_reflect_what_is_published() {
        assert_eq!(REFLECTANCES.map(|row| row.0).as_slice(), METALS.iter().map(|m| m.0[0]).collect::<Vec<_>>());
        for (name, own, measured, apart) in REFLECTANCES {
            let (eta, k) = metal(name).unwrap();
            let found = [0, 1, 2].map(|c| conductor(1.0, eta[c].into(), k[c].into()));
            let within = |of: [f64; 3], limit: f64| (0..3).all(|c| (found[c] - of[c]).abs() < limit);
            assert!(within(own, 1e-4) && within(measured, apart), "{name}: {found:?}");
        }
    }

    #[test]
    fn metals_have_names() {
        assert_eq!(metal("Gold").unwrap(), metal("au").unwrap());
        assert!(metal("unobtainium").unwrap_err().contains("gold"));
    }
}
