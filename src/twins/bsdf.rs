//! Twin of `glsl/shared/bsdf.glsl`. Local frame: z = shading normal on the front side; both directions leave the surface.
use crate::layout::{
    BSDF_COATED, BSDF_CONDUCTOR, BSDF_DIELECTRIC, BSDF_METALLIC, MATERIAL_GGX, MATERIAL_NONLINEAR, Material,
};
use crate::math::fresnel::{fresnel_conductor, fresnel_dielectric};
use crate::math::microfacet::{microfacet_area, microfacet_d, microfacet_g1, microfacet_sample};
use crate::math::warp::{INV_PI, warp_cosine_hemisphere};
use crate::scene::CoatRow;
use crate::shaders::shared::bsdf::LEAST_TINT;
use crate::twins::coat::{coat_row_at, row_inside, row_outside};
use crate::twins::metallic::{Metallic, Parameters};
use glam::{Vec2, Vec3, Vec4, vec2, vec3};

/// A material resolved at the hit. Members as in [`Material`].
#[derive(Clone, Copy, Debug)]
pub struct Bsdf {
    /// One of the BSDF_ constants.
    pub kind: u32,
    /// Diffuse albedo per channel.
    pub albedo: Vec3,
    /// Roughness; below [`SMOOTH_ALPHA`] the interface is smooth.
    pub alpha: f32,
    /// Roughness along y over `alpha`, which is that along x.
    pub stretch: f32,
    /// Index per channel (conductor), interior / exterior in x (dielectric, coated).
    pub eta: Vec3,
    /// Extinction of a conductor, per channel.
    pub k: Vec3,
    /// Tint of reflected light.
    pub specular: Vec3,
    /// Tint of refracted light.
    pub transmission: Vec3,
    /// Mean internal Fresnel reflectance (smooth coat).
    pub internal_fresnel: f32,
    /// Row of a rough coat's table at `alpha`, which the kernel reads where it needs it.
    pub coat: CoatRow,
    /// Light below a coat takes on the base's colour at every turn.
    pub nonlinear: bool,
    /// Whether microfacets are GGX, not Beckmann.
    pub ggx: bool,
    /// Of that kind, which has no other members.
    pub metallic: Metallic,
}

/// A direction that [`bsdf_sample`] chose.
#[derive(Clone, Copy, Debug)]
pub struct BsdfSample {
    /// Local unit direction towards the light.
    pub wi: Vec3,
    /// f |cos| / pdf; a delta lobe's weight includes the probability of choosing it.
    pub weight: Vec3,
    /// Density per steradian; 0 for a delta lobe.
    pub pdf: f32,
    /// Whether the lobe is a delta.
    pub delta: bool,
}

pub use crate::layout::SMOOTH_ALPHA;
pub use crate::shaders::shared::microfacet::GRAZING;

impl Bsdf {
    /// A material of constant colours with this roughness. `texels` are the scene's, which hold the tables of rough coats.
    pub fn new(m: &Material, alpha: f32, texels: &[u32]) -> Self {
        let [albedo, eta, k] = [m.base_color, m.eta, m.k].map(Vec3::from);
        let [specular, transmission] = [m.specular, m.transmission].map(Vec3::from);
        let [ggx, nonlinear] = [MATERIAL_GGX, MATERIAL_NONLINEAR].map(|flag| m.flags & flag != 0);
        let (kind, internal_fresnel) = (m.kind, m.internal_fresnel);
        let has_table = kind == BSDF_COATED && alpha >= SMOOTH_ALPHA;
        let table = texels.get(m.coat_table as usize..).filter(|_| has_table).unwrap_or(&[]);
        let coat = coat_row_at(table, alpha);
        let metallic = Metallic::new(&Parameters {
            base: albedo,
            metallic: m.metallic,
            f0: specular,
            f90: m.specular_factor,
            transmission: m.transmission_factor,
            alpha,
            coat: [m.clearcoat, m.clearcoat_alpha],
        });
        let stretch = 1.0 + m.anisotropy;
        Self {
            kind,
            albedo,
            alpha,
            stretch,
            eta,
            k,
            specular,
            transmission,
            internal_fresnel,
            coat,
            nonlinear,
            ggx,
            metallic,
        }
    }
}

fn is_smooth(b: &Bsdf) -> bool {
    b.alpha < SMOOTH_ALPHA
}

/// A direction seen from microfacets of roughness alpha that were drawn out along y.
fn undrawn(b: &Bsdf, w: Vec3) -> Vec3 {
    vec3(w.x, w.y * b.stretch, w.z)
}

/// D(m) of the microfacets, per steradian.
fn facet_density(b: &Bsdf, m: Vec3) -> f32 {
    microfacet_d(b.ggx, vec3(m.x, m.y / b.stretch, m.z), b.alpha) / b.stretch
}

/// Projected area of the microfacets visible along w.
fn facet_area(b: &Bsdf, w: Vec3) -> f32 {
    microfacet_area(b.ggx, undrawn(b, w), b.alpha)
}

/// A normal visible from w.
fn facet_sample(b: &Bsdf, w: Vec3, u: Vec2) -> Vec3 {
    let m = microfacet_sample(b.ggx, undrawn(b, w), b.alpha, u);
    if b.stretch == 1.0 { m } else { undrawn(b, m).normalize() }
}

fn half_vector(a: Vec3, b: Vec3) -> Vec3 {
    let h = a + b;
    h * (1.0 / h.length_squared().max(1e-30).sqrt())
}

fn mirror(w: Vec3, m: Vec3) -> Vec3 {
    2.0 * w.dot(m) * m - w
}

fn mean3(v: Vec3) -> f32 {
    (v.x + v.y + v.z) * (1.0 / 3.0)
}

fn evaluate_diffuse(b: &Bsdf, wi: Vec3) -> Vec4 {
    b.albedo.extend(1.0) * (wi.z * INV_PI)
}

/// G1(wo) G1(wi) area(wo) / wo.z: the weight of a visible-normal sample before its Fresnel factor.
fn visible_weight(b: &Bsdf, wo: Vec3, wi: Vec3, area: f32) -> f32 {
    let g1 = |w: Vec3| microfacet_g1(b.ggx, undrawn(b, w), b.alpha);
    let g = g1(wo) * g1(vec3(wi.x, wi.y, wi.z.abs()));
    g * area / wo.z
}

/// Torrance-Sparrow reflection without its Fresnel factor: x = f cos, y = pdf.
fn evaluate_reflection(b: &Bsdf, wo: Vec3, wi: Vec3, m: Vec3) -> Vec2 {
    let area = facet_area(b, wo);
    let pdf = facet_density(b, m) / (4.0 * area);
    vec2(visible_weight(b, wo, wi, area) * pdf, pdf)
}

fn evaluate_conductor(b: &Bsdf, wo: Vec3, wi: Vec3) -> Vec4 {
    if is_smooth(b) {
        return Vec4::ZERO;
    }
    let m = half_vector(wo, wi);
    let r = evaluate_reflection(b, wo, wi, m);
    (b.specular * fresnel_conductor(wo.dot(m), b.eta, b.k) * r.x).extend(r.y)
}

fn sample_conductor(b: &Bsdf, wo: Vec3, u: Vec2) -> (bool, BsdfSample) {
    let delta = is_smooth(b);
    let m = if delta { Vec3::Z } else { facet_sample(b, wo, u) };
    let weight = b.specular * fresnel_conductor(wo.dot(m), b.eta, b.k);
    let mut s = BsdfSample { wi: mirror(wo, m), weight, pdf: 0.0, delta };
    if !delta {
        let area = facet_area(b, wo);
        s.weight *= visible_weight(b, wo, s.wi, area);
        s.pdf = facet_density(b, m) / (4.0 * area);
    }
    (s.wi.z > GRAZING && wo.dot(m) > 0.0, s)
}

/// Index beyond / index on the side of wo; a rough interface needs the two to differ.
pub fn relative_index(b: &Bsdf, wo_z: f32) -> f32 {
    let eta = if !is_smooth(b) && (b.eta.x - 1.0).abs() < 1e-3 { 1.001 } else { b.eta.x };
    if wo_z < 0.0 { 1.0 / eta } else { eta }
}

/// Density of wi over solid angle times area(wo) (Walter et al. 2007, eq. 17); n = index on wi's side / on wo's.
fn scattered_density(b: &Bsdf, m: Vec3, n: f32, co: f32, ci: f32) -> f32 {
    let q = co + n * ci;
    facet_density(b, m) * co * ci.abs() * n * n / (q * q).max(1e-30)
}

fn evaluate_dielectric(b: &Bsdf, mut wo: Vec3, mut wi: Vec3) -> Vec4 {
    let eta = relative_index(b, wo.z);
    wi.z = if wo.z < 0.0 { -wi.z } else { wi.z };
    wo.z = wo.z.abs();
    let reflected = wi.z > 0.0;
    let n = if reflected { 1.0 } else { eta };
    let m = half_vector(wo, n * wi);
    let m = if m.z < 0.0 { -m } else { m };
    let (co, ci) = (wo.dot(m), wi.dot(m));
    if is_smooth(b) || wo.z < GRAZING || wi.z.abs() < GRAZING || co <= 0.0 || ci * wi.z <= 0.0 {
        return Vec4::ZERO;
    }
    let f = fresnel_dielectric(co, eta).x;
    let area = facet_area(b, wo);
    let pdf = (if reflected { f } else { 1.0 - f }) * scattered_density(b, m, n, co, ci) / area;
    let tint = if reflected { b.specular } else { b.transmission };
    (tint * (visible_weight(b, wo, wi, area) * pdf / (n * n))).extend(pdf)
}

fn sample_dielectric(b: &Bsdf, mut wo: Vec3, u_lobe: f32, u: Vec2) -> (bool, BsdfSample) {
    let delta = is_smooth(b);
    let eta = relative_index(b, wo.z);
    let side = if wo.z < 0.0 { -1.0 } else { 1.0 };
    wo.z = wo.z.abs();
    let m = if delta { Vec3::Z } else { facet_sample(b, wo, u) };
    let co = wo.dot(m);
    let f = fresnel_dielectric(co, eta);
    let reflected = u_lobe < f.x;
    let n = if reflected { 1.0 } else { eta };
    let ci = if reflected { co } else { -f.y };
    let wi = (co / n + ci) * m - wo / n;
    let weight = (if reflected { b.specular } else { b.transmission }) / (n * n);
    let mut s = BsdfSample { wi: vec3(wi.x, wi.y, side * wi.z), weight, pdf: 0.0, delta };
    if !delta {
        let area = facet_area(b, wo);
        s.weight *= visible_weight(b, wo, wi, area);
        s.pdf = (if reflected { f.x } else { 1.0 - f.x }) * scattered_density(b, m, n, co, ci) / area;
    }
    (wo.z >= GRAZING && co > 0.0 && (if reflected { wi.z > GRAZING } else { wi.z < -GRAZING }), s)
}

/// Probability of the coat's own reflection.
fn coat_probability(b: &Bsdf, f: f32) -> f32 {
    let specular = f * mean3(b.specular);
    specular / (specular + (1.0 - f) * mean3(b.albedo)).max(1e-10)
}

/// The share of light at cosine `c` that the coat does not let in.
fn coat_outside(b: &Bsdf, c: f32) -> f32 {
    if is_smooth(b) { fresnel_dielectric(c, b.eta.x).x } else { row_outside(&b.coat, c) }
}

fn evaluate_coated(b: &Bsdf, wo: Vec3, wi: Vec3) -> Vec4 {
    let (fo, fi) = (coat_outside(b, wo.z), coat_outside(b, wi.z));
    let p = coat_probability(b, fo);
    let inside = if is_smooth(b) { b.internal_fresnel } else { row_inside(&b.coat) };
    let back = if b.nonlinear { b.albedo * inside } else { Vec3::splat(inside) };
    let through = (1.0 - fo) * (1.0 - fi) / (b.eta.x * b.eta.x * (1.0 - back));
    let value = evaluate_diffuse(b, wi) * through.extend(1.0 - p);
    if is_smooth(b) {
        return value;
    }
    let m = half_vector(wo, wi);
    let r = evaluate_reflection(b, wo, wi, m);
    value + (b.specular * (fresnel_dielectric(wo.dot(m), b.eta.x).x * r.x)).extend(p * r.y)
}

fn sample_coated(b: &Bsdf, wo: Vec3, u_lobe: f32, u: Vec2) -> (bool, BsdfSample) {
    let f = coat_outside(b, wo.z);
    let p = coat_probability(b, f);
    let specular = u_lobe < p;
    let delta = specular && is_smooth(b);
    let m = if specular && !delta { facet_sample(b, wo, u) } else { Vec3::Z };
    let wi = if specular { mirror(wo, m) } else { warp_cosine_hemisphere(u) };
    let mut s = BsdfSample { wi, weight: b.specular * (f / p.max(1e-10)), pdf: 0.0, delta };
    let above = s.wi.z > GRAZING;
    if above && !delta {
        let value = evaluate_coated(b, wo, s.wi);
        s.weight = value.truncate() / value.w.max(1e-30);
        s.pdf = value.w;
    }
    (above, s)
}

fn sample_metallic(b: &Bsdf, wo: Vec3, u_lobe: f32, u: Vec2) -> (bool, BsdfSample) {
    let lobe = b.metallic.sample(wo, u_lobe, u);
    let mut s = BsdfSample { wi: lobe.wi, weight: lobe.weight, pdf: 0.0, delta: lobe.delta };
    if !lobe.scattered || lobe.delta {
        return (lobe.scattered, s);
    }
    let value = bsdf_evaluate(b, wo, s.wi);
    s.weight = value.truncate() / value.w.max(1e-30);
    s.pdf = value.w;
    (value.w > 0.0, s)
}

/// rgb = f |cos wi|, w = density over solid angle with which [`bsdf_sample`] picks `wi`. Delta lobes count as 0.
pub fn bsdf_evaluate(b: &Bsdf, wo: Vec3, wi: Vec3) -> Vec4 {
    if b.kind == BSDF_DIELECTRIC {
        return evaluate_dielectric(b, wo, wi);
    }
    match b.kind {
        BSDF_METALLIC if wo.z.min(wi.z.abs()) > GRAZING => b.metallic.evaluate(wo, wi),
        _ if wo.z.min(wi.z) <= GRAZING => Vec4::ZERO,
        BSDF_CONDUCTOR => evaluate_conductor(b, wo, wi),
        BSDF_COATED => evaluate_coated(b, wo, wi),
        _ => evaluate_diffuse(b, wi),
    }
}

/// False: the path is absorbed, and the sample holds nothing of use. `u_lobe`, `u` in [0, 1).
pub fn bsdf_sample(b: &Bsdf, wo: Vec3, u_lobe: f32, u: Vec2) -> (bool, BsdfSample) {
    if b.kind == BSDF_DIELECTRIC {
        return sample_dielectric(b, wo, u_lobe, u);
    }
    let wi = warp_cosine_hemisphere(u);
    let diffuse = BsdfSample { wi, weight: b.albedo, pdf: wi.z * INV_PI, delta: false };
    match b.kind {
        _ if wo.z <= GRAZING => (false, diffuse),
        BSDF_CONDUCTOR => sample_conductor(b, wo, u),
        BSDF_COATED => sample_coated(b, wo, u_lobe, u),
        BSDF_METALLIC => sample_metallic(b, wo, u_lobe, u),
        _ => (true, diffuse),
    }
}

/// Whether there is a lobe around the mirror image of `wo`.
pub fn bsdf_is_specular(b: &Bsdf) -> bool {
    matches!(b.kind, BSDF_CONDUCTOR | BSDF_DIELECTRIC | BSDF_COATED | BSDF_METALLIC)
}

/// The lobe of rough microfacets around the mirror image of `wo`: the probability that [`bsdf_sample`] takes it, and its roughness, the
/// greater of two. A clear coat's lobe does not count.
pub fn bsdf_gloss(b: &Bsdf, wo: Vec3) -> (f32, f32) {
    let share = match b.kind {
        _ if is_smooth(b) => 0.0,
        BSDF_CONDUCTOR => 1.0,
        BSDF_DIELECTRIC => fresnel_dielectric(wo.z.abs(), relative_index(b, wo.z)).x,
        BSDF_COATED => coat_probability(b, coat_outside(b, wo.z)),
        BSDF_METALLIC => b.metallic.odds(wo).y,
        _ => 0.0,
    };
    (share, b.alpha * b.stretch.max(1.0))
}

/// Whether every lobe is a delta.
pub fn bsdf_is_delta(b: &Bsdf) -> bool {
    match b.kind {
        BSDF_METALLIC => b.metallic.is_delta(),
        _ => matches!(b.kind, BSDF_CONDUCTOR | BSDF_DIELECTRIC) && is_smooth(b),
    }
}

/// The probability of the way that [`bsdf_sample`] chooses by `u_lobe`, where every lobe is a delta: 1 where light has one way alone, and 0
/// of a way less likely than not.
pub fn bsdf_share(b: &Bsdf, wo: Vec3, u_lobe: f32) -> f32 {
    let chance = match b.kind {
        BSDF_METALLIC => b.metallic.chance(wo, u_lobe),
        BSDF_DIELECTRIC => {
            let reflected = fresnel_dielectric(wo.z.abs(), relative_index(b, wo.z)).x;
            if u_lobe < reflected { reflected } else { 1.0 - reflected }
        }
        _ => 1.0,
    };
    if chance < 0.5 { 0.0 } else { chance }
}

/// The albedo that a path of this `throughput` keeps of a surface. Where it came a way that it takes with the probability `share`, what
/// lies the other way counts as white. Deep colours count as [`LEAST_TINT`] of their strongest channel at least.
pub fn seen_albedo(throughput: Vec3, albedo: Vec3, share: f32) -> Vec3 {
    let tint = throughput.min(Vec3::ONE);
    tint.max(Vec3::splat(LEAST_TINT * tint.max_element())) * Vec3::ONE.lerp(albedo, share)
}

/// Whether some lobe leaves on the other side.
pub fn bsdf_lets_light_through(b: &Bsdf) -> bool {
    match b.kind {
        BSDF_METALLIC => b.metallic.through != Vec3::ZERO,
        _ => b.kind == BSDF_DIELECTRIC,
    }
}

/// Reflectance, roughly, seen at the cosine `wo_z`: what light is divided by before it is filtered. Mirrors and clear glass have
/// none of their own.
pub fn bsdf_albedo(b: &Bsdf, wo_z: f32) -> Vec3 {
    let cosine = wo_z.abs();
    let layered = |eta: f32, beneath: Vec3| beneath.lerp(b.specular, fresnel_dielectric(cosine, eta).x);
    match b.kind {
        _ if bsdf_is_delta(b) => Vec3::ZERO,
        BSDF_CONDUCTOR => b.specular * fresnel_conductor(cosine, b.eta, b.k),
        BSDF_DIELECTRIC => layered(relative_index(b, wo_z), b.transmission),
        BSDF_COATED => layered(b.eta.x, b.albedo),
        BSDF_METALLIC => b.metallic.albedo(cosine),
        _ => b.albedo,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::{BSDF_DIFFUSE, COAT_COLUMNS};

    const GLASS: Bsdf = Bsdf {
        kind: BSDF_DIELECTRIC,
        albedo: Vec3::ONE,
        alpha: 0.0,
        stretch: 1.0,
        eta: Vec3::splat(1.5),
        k: Vec3::ZERO,
        specular: Vec3::ONE,
        transmission: Vec3::ONE,
        internal_fresnel: 0.0,
        coat: [0.0; COAT_COLUMNS as usize],
        nonlinear: false,
        ggx: false,
        metallic: Metallic {
            diffuse: Vec3::ZERO,
            through: Vec3::ZERO,
            f0: Vec3::ZERO,
            f90: 0.0,
            dielectric: [0.0; 2],
            alpha: 0.0,
            coat: 0.0,
            coat_alpha: 0.0,
            coat_normal: Vec3::Z,
        },
    };

    #[test]
    fn glass_obeys_snell_and_scales_radiance() {
        let wo = vec3(0.6, 0.0, 0.8);
        let (sampled, s) = bsdf_sample(&GLASS, wo, 0.99, Vec2::ZERO);
        assert!(sampled && s.delta && (s.wi - vec3(-0.4, 0.0, -0.84f32.sqrt())).length() < 1e-6, "{s:?}");
        assert!((s.weight.x - 1.0 / 2.25).abs() < 1e-6);
        // Seen from where it went, the ray comes back, and the radiance with it.
        let (sampled, back) = bsdf_sample(&GLASS, s.wi, 0.99, Vec2::ZERO);
        assert!(sampled && (back.wi - wo).length() < 1e-6 && (back.weight.x - 2.25).abs() < 1e-5, "{back:?}");
    }

    #[test]
    fn albedo_is_that_of_all_lobes_and_none_of_mirrors_and_clear_glass() {
        let base = Bsdf { albedo: Vec3::splat(0.5), specular: Vec3::splat(0.8), ..GLASS };
        let of = |kind, alpha, cosine| {
            let mut b = base;
            (b.kind, b.alpha, b.k) = (kind, alpha, Vec3::splat(4.0));
            bsdf_albedo(&b, cosine).x
        };
        let f = fresnel_dielectric(0.3, 1.5).x;
        assert_eq!(
            [of(BSDF_DIELECTRIC, 0.0, 1.0), of(BSDF_CONDUCTOR, 0.0, 1.0), of(BSDF_DIFFUSE, 0.0, 0.3)],
            [0.0, 0.0, 0.5]
        );
        // 0.04 is what light meets head on: 0.5 * 0.96 + 0.8 * 0.04.
        let close = |a: f32, b: f32| assert!((a - b).abs() < 1e-5, "{a} {b}");
        close(of(BSDF_COATED, 0.2, 1.0), 0.512);
        close(of(BSDF_COATED, 0.2, 0.3), 0.5 * (1.0 - f) + 0.8 * f);
        close(of(BSDF_COATED, 0.0, 0.3), 0.5 * (1.0 - f) + 0.8 * f);
        close(of(BSDF_DIELECTRIC, 0.2, 1.0), 0.96 + 0.8 * 0.04);
        close(of(BSDF_CONDUCTOR, 0.2, 1.0), 0.8 * (0.25 + 16.0) / (6.25 + 16.0));
    }

    #[test]
    fn mirror_reflects_about_the_normal() {
        let silver = Bsdf { kind: BSDF_CONDUCTOR, eta: Vec3::ZERO + 0.05, k: Vec3::ONE * 4.0, ..GLASS };
        let (sampled, s) = bsdf_sample(&silver, vec3(0.6, 0.0, 0.8), 0.5, Vec2::ZERO);
        assert!(sampled && bsdf_is_delta(&silver) && (s.wi - vec3(-0.6, 0.0, 0.8)).length() < 1e-6);
        assert_eq!(bsdf_evaluate(&silver, vec3(0.6, 0.0, 0.8), s.wi), Vec4::ZERO);
    }
}
