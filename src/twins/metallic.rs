//! Twin of `glsl/shared/metallic.glsl`: the material of glTF 2.0. Local frame: z = shading normal on the viewer's side.
use crate::layout::SMOOTH_ALPHA;
use crate::math::microfacet::{microfacet_area, microfacet_d, microfacet_g1, microfacet_sample};
use crate::math::warp::{INV_PI, basis_from_normal, warp_cosine_hemisphere};
use crate::shaders::shared::metallic::{COAT_F0, LEAST_ODDS};
use crate::shaders::shared::microfacet::GRAZING;
use crate::twins::coat::{microfacet_means, microfacet_shares};
use glam::{Vec2, Vec3, Vec4, vec2, vec3, vec4};

/// A metallic-roughness material resolved at the hit.
#[derive(Clone, Copy, Debug)]
pub struct Metallic {
    /// Base colour of the share that is neither metal nor transparent.
    pub diffuse: Vec3,
    /// Base colour of the transparent share.
    pub through: Vec3,
    /// Reflectance head on of metal and dielectric together.
    pub f0: Vec3,
    /// Reflectance at grazing angles.
    pub f90: f32,
    /// Largest channel of the dielectric's reflectance head on, and at grazing angles.
    pub dielectric: [f32; 2],
    /// Microfacet roughness; below [`SMOOTH_ALPHA`] the lobe is a delta.
    pub alpha: f32,
    /// Strength of the clear coat, from 0 to 1.
    pub coat: f32,
    /// Microfacet roughness of the clear coat.
    pub coat_alpha: f32,
    /// Normal of the clear coat in the local frame, above the horizon of the viewer.
    pub coat_normal: Vec3,
}

/// What a material's textures and factors give at a point.
#[derive(Clone, Copy, Debug, Default)]
pub struct Parameters {
    /// Base colour.
    pub base: Vec3,
    /// Share of metal.
    pub metallic: f32,
    /// The dielectric's reflectance head on.
    pub f0: Vec3,
    /// Factor of that, and reflectance at grazing angles.
    pub f90: f32,
    /// Share of the dielectric that is transparent.
    pub transmission: f32,
    /// Microfacet roughness.
    pub alpha: f32,
    /// Strength and roughness of the clear coat.
    pub coat: [f32; 2],
}

/// A sampled lobe.
#[derive(Clone, Copy, Debug)]
pub struct LobeSample {
    /// Local unit direction towards the light.
    pub wi: Vec3,
    /// f |cos| / probability of the lobe, where it is a delta.
    pub weight: Vec3,
    /// Whether it is a delta.
    pub delta: bool,
    /// Whether light is scattered at all.
    pub scattered: bool,
}

fn smooth(alpha: f32) -> bool {
    alpha < SMOOTH_ALPHA
}

fn schlick_weight(c: f32) -> f32 {
    (1.0 - c).clamp(0.0, 1.0).powi(5)
}

/// What microfacets reflect along a cosine, of reflectance 1 head on alone and 1 at grazing angles alone.
fn reflected(alpha: f32, c: f32) -> Vec2 {
    let grazing = schlick_weight(c);
    if smooth(alpha) { vec2(1.0 - grazing, grazing) } else { microfacet_shares(alpha, c) }
}

/// Reflection by microfacets without its Fresnel factor.
struct Lobe {
    /// f cos.
    value: f32,
    /// Density per solid angle.
    density: f32,
    /// Cosine at the microfacet.
    cosine: f32,
}

fn lobe(wo: Vec3, wi: Vec3, alpha: f32) -> Lobe {
    let h = wo + wi;
    let m = h / h.length_squared().max(1e-30).sqrt();
    let area = microfacet_area(true, wo, alpha);
    let density = microfacet_d(true, m, alpha) / (4.0 * area);
    let g = microfacet_g1(true, wo, alpha) * microfacet_g1(true, wi, alpha);
    Lobe { value: g * area / wo.z * density, density, cosine: wo.dot(m).clamp(0.0, 1.0) }
}

/// The mirror image of `wo` by a visible microfacet, and whether there is only one.
fn mirrored(wo: Vec3, alpha: f32, u: Vec2) -> (Vec3, bool) {
    let delta = smooth(alpha);
    let m = if delta { Vec3::Z } else { microfacet_sample(true, wo, alpha, u) };
    (2.0 * wo.dot(m) * m - wo, delta)
}

impl Default for Metallic {
    fn default() -> Self {
        Self::new(&Parameters::default())
    }
}

impl Metallic {
    /// Mixes metal and dielectric.
    pub fn new(p: &Parameters) -> Self {
        let body = p.base * (1.0 - p.metallic);
        let f0 = p.f0.min(Vec3::ONE) * p.f90;
        Self {
            diffuse: body * (1.0 - p.transmission),
            through: body * p.transmission,
            f0: f0.lerp(p.base, p.metallic),
            f90: p.f90 + (1.0 - p.f90) * p.metallic,
            dielectric: [f0.max_element(), p.f90],
            alpha: p.alpha,
            coat: p.coat[0],
            coat_alpha: p.coat[1],
            coat_normal: Vec3::Z,
        }
    }

    fn fresnel(&self, c: f32) -> Vec3 {
        self.f0.lerp(Vec3::splat(self.f90), schlick_weight(c))
    }

    /// What all microfacets together reflect.
    fn reflects(&self, c: f32) -> Vec3 {
        let shares = reflected(self.alpha, c);
        self.f0 * shares.x + self.f90 * shares.y
    }

    /// What a microfacet of the dielectric lets through.
    fn refracts(&self, c: f32) -> f32 {
        let [f0, f90] = self.dielectric;
        1.0 - (f0 + (f90 - f0) * schlick_weight(c))
    }

    /// What all of them let in.
    fn let_in(&self, c: f32) -> f32 {
        1.0 - Vec2::from(self.dielectric).dot(reflected(self.alpha, c))
    }

    fn mean_let_in(&self) -> f32 {
        let means = if smooth(self.alpha) { vec2(20.0, 1.0) / 21.0 } else { microfacet_means(self.alpha) };
        1.0 - Vec2::from(self.dielectric).dot(means)
    }

    fn coat_lets_in(&self, c: f32) -> f32 {
        1.0 - self.coat * vec2(COAT_F0, 1.0).dot(reflected(self.coat_alpha, c))
    }

    /// Probabilities of the coat's lobe, the specular, the diffuse one, and that through a thin wall.
    pub fn odds(&self, wo: Vec3) -> Vec4 {
        let (c, mean) = (wo.z, |v: Vec3| v.element_sum() / 3.0);
        let inner = self.coat_lets_in(wo.dot(self.coat_normal));
        let base = inner * self.let_in(c);
        let specular = inner * (mean(self.reflects(c)) + LEAST_ODDS * self.f90);
        let odds = vec4(1.0 - inner, specular, base * mean(self.diffuse), base * mean(self.through));
        odds / odds.element_sum().max(1e-10)
    }

    /// rgb = f |cos wi|, w = density over solid angle with which [`Self::sample`] picks `wi`. `wo` is above the horizon.
    pub fn evaluate(&self, wo: Vec3, wi: Vec3) -> Vec4 {
        let (beyond, wi) = (wi.z < 0.0, vec3(wi.x, wi.y, wi.z.abs()));
        let (odds, mut value) = (self.odds(wo), Vec4::ZERO);
        if !beyond {
            let passes = self.let_in(wo.z) * self.let_in(wi.z) / self.mean_let_in().max(1e-3);
            value = (self.diffuse * passes).extend(odds.z) * (wi.z * INV_PI);
        }
        if !smooth(self.alpha) {
            let lobe = lobe(wo, wi, self.alpha);
            let (f, p) = match beyond {
                true => (self.through * self.refracts(lobe.cosine), odds.w),
                false => (self.fresnel(lobe.cosine), odds.y),
            };
            value += (f * lobe.value).extend(p * lobe.density);
        }
        let inner = [wo, wi].map(|w| self.coat_lets_in(w.dot(self.coat_normal))).iter().product::<f32>();
        let value = (value.truncate() * inner).extend(value.w);
        if beyond || self.coat == 0.0 || smooth(self.coat_alpha) {
            return value;
        }
        let to_coat = basis_from_normal(self.coat_normal).transpose();
        let (wo, wi) = (to_coat * wo, to_coat * wi);
        if wo.z.min(wi.z) <= GRAZING {
            return value;
        }
        let lobe = lobe(wo, wi, self.coat_alpha);
        let reflected = self.coat * (COAT_F0 + (1.0 - COAT_F0) * schlick_weight(lobe.cosine)) * lobe.value;
        value + Vec3::splat(reflected).extend(odds.x * lobe.density)
    }

    /// Samples a lobe and a direction in it. `u_lobe`, `u` in [0, 1).
    pub fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> LobeSample {
        let odds = self.odds(wo);
        let inner = self.coat_lets_in(wo.dot(self.coat_normal));
        let (alpha, weight, beyond) = match u_lobe {
            x if x < odds.x => return self.sample_coat(wo, u, (1.0 - inner) / odds.x),
            x if x < odds.x + odds.w => (self.alpha, self.through * self.refracts(wo.z) / odds.w.max(1e-10), true),
            x if x < odds.x + odds.w + odds.y => (self.alpha, self.fresnel(wo.z) / odds.y.max(1e-10), false),
            _ => {
                let wi = warp_cosine_hemisphere(u);
                return LobeSample { wi, weight: Vec3::ZERO, delta: false, scattered: true };
            }
        };
        let (wi, delta) = mirrored(wo, alpha, u);
        let weight = weight * (inner * self.coat_lets_in(wi.dot(self.coat_normal)));
        let scattered = wi.z > GRAZING;
        let wi = if beyond { vec3(wi.x, wi.y, -wi.z) } else { wi };
        LobeSample { wi, weight, delta, scattered }
    }

    fn sample_coat(&self, wo: Vec3, u: Vec2, weight: f32) -> LobeSample {
        let frame = basis_from_normal(self.coat_normal);
        let (own, delta) = mirrored(frame.transpose() * wo, self.coat_alpha, u);
        let wi = frame * own;
        LobeSample { wi, weight: Vec3::splat(weight), delta, scattered: own.z.min(wi.z) > GRAZING }
    }

    /// The probability of the lobe that [`Self::sample`] chooses of several smooth ones; 1 of a single one.
    pub fn chance(&self, wo: Vec3, u_lobe: f32) -> f32 {
        if self.coat == 0.0 && self.through == Vec3::ZERO {
            return 1.0;
        }
        let [coat, specular, diffuse, through] = self.odds(wo).to_array();
        match u_lobe {
            u if u < coat => coat,
            u if u < coat + through => through,
            u if u < coat + through + specular => specular,
            _ => diffuse,
        }
    }

    /// Approximate reflectance at the cosine `c`.
    pub fn albedo(&self, c: f32) -> Vec3 {
        let inner = self.coat_lets_in(c);
        let albedo = (self.diffuse + self.through) * self.let_in(c) + self.reflects(c);
        albedo * inner + 1.0 - inner
    }

    /// Share of the light head on that the surface reflects, of all that comes back.
    pub fn specular(&self) -> f32 {
        let (f0, base) = (self.f0.element_sum(), (self.diffuse + self.through).element_sum());
        f0 / (f0 + base).max(1e-10)
    }

    /// Whether every lobe is a delta.
    pub fn is_delta(&self) -> bool {
        smooth(self.alpha) && self.diffuse == Vec3::ZERO && (self.coat == 0.0 || smooth(self.coat_alpha))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WHITE: Parameters = Parameters {
        base: Vec3::ONE,
        metallic: 0.0,
        f0: Vec3::splat(0.04),
        f90: 1.0,
        transmission: 0.0,
        alpha: 0.25,
        coat: [0.0; 2],
    };

    #[test]
    fn numbers_are_those_of_the_specification() {
        // Head on: the dielectric reflects 0.04, the metal its base colour.
        let of = |metallic| Metallic::new(&Parameters { metallic, base: Vec3::splat(0.5), ..WHITE });
        assert_eq!([of(0.0).fresnel(1.0).x, of(1.0).fresnel(1.0).x], [0.04, 0.5]);
        assert!((of(0.5).fresnel(1.0).x - 0.27).abs() < 1e-6 && of(0.5).fresnel(0.0).x == 1.0);
        // Half of it is metal, of which no light comes back diffusely.
        assert_eq!([of(0.5).diffuse.x, of(1.0).diffuse.x], [0.25, 0.0]);
        let weak = Metallic::new(&Parameters { f90: 0.5, f0: Vec3::splat(2.0), ..WHITE });
        assert_eq!((weak.f0.x, weak.f90, weak.dielectric), (0.5, 0.5, [0.5, 0.5]), "f0 is limited before its factor");
    }

    #[test]
    fn a_smooth_thin_wall_lets_light_pass_straight() {
        let b = Metallic::new(&Parameters { alpha: 0.0, transmission: 1.0, base: vec3(0.5, 1.0, 0.25), ..WHITE });
        assert!(b.is_delta());
        let wo = vec3(0.6, 0.0, 0.8);
        let s = b.sample(wo, 0.0, Vec2::ZERO);
        assert!(s.scattered && s.delta && (s.wi + wo).length() < 1e-6, "{s:?}");
        let expected = b.through * b.refracts(0.8) / b.odds(wo).w;
        assert!((s.weight - expected).length() < 1e-6);
        assert!(!Metallic::new(&Parameters { alpha: 0.0, ..WHITE }).is_delta(), "a diffuse base");
    }
}
