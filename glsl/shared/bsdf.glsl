// Scattering at a surface point. Local frame: z = shading normal on the front side. `wo` points to the camera, `wi` to the
// light; both leave the surface. Radiance is transported: refraction scales it by 1 / eta^2.
// Needs effects.glsl and layout.glsl.
#ifndef BSDF_GLSL
#define BSDF_GLSL
#include "shared/warp.glsl"
#include "shared/fresnel.glsl"
#include "shared/microfacet.glsl"

// A material resolved at the hit. Members as in Material.
struct Bsdf {
    uint kind;
    vec3 albedo;
    float alpha;
    vec3 eta;
    vec3 k;
    vec3 specular;
    vec3 transmission;
    float internal_fresnel;
    bool ggx;
};

// weight = f |cos| / pdf. A delta lobe has pdf 0 and carries its probability in the weight alone.
struct BsdfSample {
    vec3 wi;
    vec3 weight;
    float pdf;
    bool delta;
};

// Interfaces below this roughness are smooth; directions closer to the horizon than GRAZING count as below it.
const float SMOOTH_ALPHA = 0.01;
const float GRAZING = 1e-9;
const vec3 UP = vec3(0.0, 0.0, 1.0);

// With one kind in the scene the test for it folds away.
const bool ONE_KIND = uint(FX_DIFFUSE) + uint(FX_CONDUCTOR) + uint(FX_DIELECTRIC) + uint(FX_COATED) == 1u;

bool is_kind(bool effect, Bsdf b, uint kind) {
    return effect && (ONE_KIND || b.kind == kind);
}

bool is_smooth(Bsdf b) {
    return FX_SMOOTH && (!FX_ROUGH || b.alpha < SMOOTH_ALPHA);
}

// Unit where a + b is not zero, finite where it is.
vec3 half_vector(vec3 a, vec3 b) {
    vec3 h = a + b;
    return h * inversesqrt(max(dot(h, h), 1e-30));
}

vec3 mirror(vec3 w, vec3 m) {
    return 2.0 * dot(w, m) * m - w;
}

float mean3(vec3 v) {
    return (v.x + v.y + v.z) * (1.0 / 3.0);
}

vec4 evaluate_diffuse(Bsdf b, vec3 wi) {
    return vec4(b.albedo, 1.0) * (wi.z * INV_PI);
}

// Shadowing and masking of a sample drawn by visible normals: G1(wo) G1(wi) area(wo) / wo.z. It is G1(wi) but for the 0.4 %
// between Walter's fit of the Beckmann G1, which f uses, and the exact one, which the pdf needs to integrate to 1.
float visible_weight(Bsdf b, vec3 wo, vec3 wi, float area) {
    float g = microfacet_g1(b.ggx, wo, b.alpha) * microfacet_g1(b.ggx, vec3(wi.xy, abs(wi.z)), b.alpha);
    return g * area / wo.z;
}

// Torrance-Sparrow reflection without its Fresnel factor about the half vector m: x = f cos, y = pdf.
vec2 evaluate_reflection(Bsdf b, vec3 wo, vec3 wi, vec3 m) {
    float area = microfacet_area(b.ggx, wo, b.alpha);
    float pdf = microfacet_d(b.ggx, m, b.alpha) / (4.0 * area);
    return vec2(visible_weight(b, wo, wi, area) * pdf, pdf);
}

vec4 evaluate_conductor(Bsdf b, vec3 wo, vec3 wi) {
    if (is_smooth(b)) return vec4(0.0);
    vec3 m = half_vector(wo, wi);
    vec2 r = evaluate_reflection(b, wo, wi, m);
    return vec4(b.specular * fresnel_conductor(dot(wo, m), b.eta, b.k) * r.x, r.y);
}

bool sample_conductor(Bsdf b, vec3 wo, vec2 u, out BsdfSample s) {
    bool delta = is_smooth(b);
    vec3 m = UP;
    if (!delta) m = microfacet_sample(b.ggx, wo, b.alpha, u);
    s = BsdfSample(mirror(wo, m), b.specular * fresnel_conductor(dot(wo, m), b.eta, b.k), 0.0, delta);
    if (!delta) {
        float area = microfacet_area(b.ggx, wo, b.alpha);
        s.weight *= visible_weight(b, wo, s.wi, area);
        s.pdf = microfacet_d(b.ggx, m, b.alpha) / (4.0 * area);
    }
    return s.wi.z > GRAZING && dot(wo, m) > 0.0;
}

// Index beyond / index on the side of wo. A rough interface needs the two to differ: equal indices refract along one
// direction only, so 1 counts as 1.001, which bends light by less than the smallest alpha.
float relative_index(Bsdf b, float wo_z) {
    float eta = !is_smooth(b) && abs(b.eta.x - 1.0) < 1e-3 ? 1.001 : b.eta.x;
    return wo_z < 0.0 ? 1.0 / eta : eta;
}

// Density of wi over solid angle times area(wo), for the visible normal m and n = index on wi's side / on wo's
// (Walter et al. 2007, eq. 17; with n = 1 it is eq. 14). `co` = wo.m, `ci` = wi.m.
float scattered_density(Bsdf b, vec3 m, float n, float co, float ci) {
    float q = co + n * ci;
    return microfacet_d(b.ggx, m, b.alpha) * co * abs(ci) * n * n / max(q * q, 1e-30);
}

// Works on the side of wo: both z flip together when wo is inside.
vec4 evaluate_dielectric(Bsdf b, vec3 wo, vec3 wi) {
    float eta = relative_index(b, wo.z);
    wi.z = wo.z < 0.0 ? -wi.z : wi.z;
    wo.z = abs(wo.z);
    bool reflected = wi.z > 0.0;
    float n = reflected ? 1.0 : eta;
    vec3 m = half_vector(wo, n * wi);
    m = m.z < 0.0 ? -m : m;
    float co = dot(wo, m);
    float ci = dot(wi, m);
    if (is_smooth(b) || wo.z < GRAZING || abs(wi.z) < GRAZING || co <= 0.0 || ci * wi.z <= 0.0) return vec4(0.0);
    float f = fresnel_dielectric(co, eta).x;
    float area = microfacet_area(b.ggx, wo, b.alpha);
    float pdf = (reflected ? f : 1.0 - f) * scattered_density(b, m, n, co, ci) / area;
    vec3 tint = reflected ? b.specular : b.transmission;
    return vec4(tint * (visible_weight(b, wo, wi, area) * pdf / (n * n)), pdf);
}

bool sample_dielectric(Bsdf b, vec3 wo, float u_lobe, vec2 u, out BsdfSample s) {
    bool delta = is_smooth(b);
    float eta = relative_index(b, wo.z);
    float side = wo.z < 0.0 ? -1.0 : 1.0;
    wo.z = abs(wo.z);
    vec3 m = UP;
    if (!delta) m = microfacet_sample(b.ggx, wo, b.alpha, u);
    float co = dot(wo, m);
    vec2 f = fresnel_dielectric(co, eta);
    bool reflected = u_lobe < f.x;
    float n = reflected ? 1.0 : eta;
    float ci = reflected ? co : -f.y;
    vec3 wi = (co / n + ci) * m - wo / n;
    s = BsdfSample(vec3(wi.xy, side * wi.z), (reflected ? b.specular : b.transmission) / (n * n), 0.0, delta);
    if (!delta) {
        float area = microfacet_area(b.ggx, wo, b.alpha);
        s.weight *= visible_weight(b, wo, wi, area);
        s.pdf = (reflected ? f.x : 1.0 - f.x) * scattered_density(b, m, n, co, ci) / area;
    }
    return wo.z >= GRAZING && co > 0.0 && (reflected ? wi.z > GRAZING : wi.z < -GRAZING);
}

// Probability of the coat's own reflection: each lobe's share of the reflected energy, roughly.
float coat_probability(Bsdf b, float f) {
    float specular = f * mean3(b.specular);
    return specular / max(specular + (1.0 - f) * mean3(b.albedo), 1e-10);
}

// Mitsuba 3's `plastic` with `nonlinear` off: light enters and leaves through smooth Fresnel transmittance, and the
// reflections inside add up to 1 / (1 - internal_fresnel). Its rough variant differs by a tabulated transmittance.
vec4 evaluate_coated(Bsdf b, vec3 wo, vec3 wi) {
    float fo = fresnel_dielectric(wo.z, b.eta.x).x;
    float fi = fresnel_dielectric(wi.z, b.eta.x).x;
    float p = coat_probability(b, fo);
    float through = (1.0 - fo) * (1.0 - fi) / (b.eta.x * b.eta.x * (1.0 - b.internal_fresnel));
    vec4 value = evaluate_diffuse(b, wi) * vec4(vec3(through), 1.0 - p);
    if (is_smooth(b)) return value;
    vec3 m = half_vector(wo, wi);
    vec2 r = evaluate_reflection(b, wo, wi, m);
    return value + vec4(b.specular * (fresnel_dielectric(dot(wo, m), b.eta.x).x * r.x), p * r.y);
}

bool sample_coated(Bsdf b, vec3 wo, float u_lobe, vec2 u, out BsdfSample s) {
    float f = fresnel_dielectric(wo.z, b.eta.x).x;
    float p = coat_probability(b, f);
    bool specular = u_lobe < p;
    bool delta = specular && is_smooth(b);
    vec3 m = UP;
    if (specular && !delta) m = microfacet_sample(b.ggx, wo, b.alpha, u);
    s = BsdfSample(specular ? mirror(wo, m) : warp_cosine_hemisphere(u), b.specular * (f / max(p, 1e-10)), 0.0, delta);
    bool above = s.wi.z > GRAZING;
    if (above && !delta) {
        vec4 value = evaluate_coated(b, wo, s.wi);
        s.weight = value.rgb / max(value.w, 1e-30);
        s.pdf = value.w;
    }
    return above;
}

// rgb = f |cos wi|, w = density over solid angle with which bsdf_sample picks wi. Delta lobes count as 0.
vec4 bsdf_evaluate(Bsdf b, vec3 wo, vec3 wi) {
    if (is_kind(FX_DIELECTRIC, b, BSDF_DIELECTRIC)) return evaluate_dielectric(b, wo, wi);
    if (min(wo.z, wi.z) <= GRAZING) return vec4(0.0);
    if (is_kind(FX_CONDUCTOR, b, BSDF_CONDUCTOR)) return evaluate_conductor(b, wo, wi);
    if (is_kind(FX_COATED, b, BSDF_COATED)) return evaluate_coated(b, wo, wi);
    return evaluate_diffuse(b, wi);
}

// False: the path is absorbed, and `s` holds nothing of use. `u_lobe` chooses the lobe, `u` the direction in it.
bool bsdf_sample(Bsdf b, vec3 wo, float u_lobe, vec2 u, out BsdfSample s) {
    if (is_kind(FX_DIELECTRIC, b, BSDF_DIELECTRIC)) return sample_dielectric(b, wo, u_lobe, u, s);
    vec3 wi = warp_cosine_hemisphere(u);
    s = BsdfSample(wi, b.albedo, wi.z * INV_PI, false);
    if (wo.z <= GRAZING) return false;
    if (is_kind(FX_CONDUCTOR, b, BSDF_CONDUCTOR)) return sample_conductor(b, wo, u, s);
    if (is_kind(FX_COATED, b, BSDF_COATED)) return sample_coated(b, wo, u_lobe, u, s);
    return true;
}

// A conductor or a dielectric: light scatters at its surface alone.
bool is_interface(Bsdf b) { return is_kind(FX_CONDUCTOR, b, BSDF_CONDUCTOR) || is_kind(FX_DIELECTRIC, b, BSDF_DIELECTRIC); }

// Every lobe is a delta: no light sample can contribute, and a filter has nothing to blur.
bool bsdf_is_delta(Bsdf b) { return is_interface(b) && is_smooth(b); }

// What indirect light is divided by before it is filtered: 0 where all light counts as direct, so that none leaks in.
vec3 bsdf_albedo(Bsdf b) {
    if (!is_interface(b)) return b.albedo;
    return is_smooth(b) ? vec3(0.0) : b.specular;
}

#endif
