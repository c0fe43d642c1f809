// The material of glTF 2.0, appendix B, with its extensions for specular reflection, thin transmission and a clear coat: a mixture
// of a metal and of a dielectric above a base, which is diffuse or lets light through. Local frame and conventions: see bsdf.glsl.
// Fresnel reflectances are Schlick's, F(c) = f0 + (f90 - f0) (1 - c)^5 at the cosine c; microfacets are GGX.
// Needs the binding `texels`, which holds the table of what they reflect.
#include "shared/largest_channel.glsl"
#include "shared/warp.glsl"
#include "shared/microfacet.glsl"
#include "shared/coat_table.glsl"

struct Metallic {
    vec3 diffuse;    // base colour of the share that is neither metal nor transparent
    vec3 through;    // base colour of the transparent share
    vec3 f0;         // reflectance head on, of metal and dielectric together
    float f90;       // and at grazing angles
    vec2 dielectric; // largest channel of the dielectric's reflectance head on, and at grazing angles
    float alpha;
    float coat;      // strength of the clear coat
    float coat_alpha;
    vec3 coat_normal; // in the local frame, above the horizon of the viewer
    uint table;       // of what rough microfacets reflect, among the texels
    // metallic_view computes these once:
    vec2 reflected;    // by the microfacets, of light along the viewer: see metallic_reflected
    float mean_let_in; // of light from everywhere
};

const float COAT_F0 = 0.04; // reflectance head on of a clear coat, of index 1.5

// The probability of the specular lobe is at least this share of f90, since its reflectance at the half vector may be above 0
// where that at the normal is 0.
const float LEAST_ODDS = 0.02;

float schlick_weight(float c) {
    float x = clamp(1.0 - c, 0.0, 1.0);
    return x * x * x * x * x;
}

// Share of light at the cosine `c` that a microfacet of the dielectric refracts, at most: of all channels alike, so that it keeps
// its colour.
float refracted(Metallic b, float c) {
    return 1.0 - mix(b.dielectric.x, b.dielectric.y, schlick_weight(c));
}

// Cosine at which the clear coat sees a direction.
float coat_cosine(Metallic b, vec3 w) {
    return FX_COAT_NORMALS ? dot(w, b.coat_normal) : w.z;
}

vec2 microfacet_entry(uint table, float alpha, float column) {
    TableCell cell = table_cell(table, table_row(alpha), column);
    vec2 left = mix(unpackUnorm2x16(cell.words.x), unpackUnorm2x16(cell.words.z), cell.within.y);
    vec2 right = mix(unpackUnorm2x16(cell.words.y), unpackUnorm2x16(cell.words.w), cell.within.y);
    return mix(left, right, cell.within.x);
}

// Share of light at the cosine `c` that microfacets reflect above the horizon: x where F is 1 head on and 0 at grazing angles, y
// where it is 0 and 1. All of them reflect f0 x + f90 y.
vec2 metallic_reflected(uint table, float alpha, float c) {
    float grazing = schlick_weight(c);
    if (smooth_alpha(alpha)) return vec2(1.0 - grazing, grazing);
    return microfacet_entry(table, alpha, table_column(c));
}

// Share of light that the microfacets of the dielectric let in, where they reflect so much.
float let_in(Metallic b, vec2 reflected) {
    return 1.0 - dot(b.dielectric, reflected);
}

// The same for the clear coat.
float coat_lets_in(Metallic b, float c) {
    return 1.0 - b.coat * dot(vec2(COAT_F0, 1.0), metallic_reflected(b.table, b.coat_alpha, c));
}

bool has_coat(Metallic b) {
    return FX_CLEARCOAT && b.coat > 0.0;
}

Metallic metallic_layers(vec3 base, float metallic, vec3 f0, float f90, float transmission, float alpha, float coat, float coat_alpha,
                         uint table) {
    Metallic b;
    b.diffuse = base * (1.0 - metallic);
    b.through = vec3(0.0);
    if (FX_THIN) {
        b.through = b.diffuse * transmission;
        b.diffuse *= 1.0 - transmission;
    }
    f0 = min(f0, 1.0) * f90;
    b.f0 = mix(f0, base, metallic);
    b.f90 = mix(f90, 1.0, metallic);
    b.dielectric = vec2(largest_channel(f0), f90);
    b.alpha = alpha;
    b.coat = coat;
    b.coat_alpha = coat_alpha;
    b.coat_normal = UP;
    b.table = table;
    b.reflected = vec2(0.0);
    b.mean_let_in = 1.0;
    return b;
}

// Must be called before the material is evaluated or sampled. The mean over a diffuse hemisphere of F(c) of a smooth interface is
// f0 + (f90 - f0) 2 Int c (1 - c)^5 dc = f0 + (f90 - f0) / 21.
void metallic_view(inout Metallic b, float cosine) {
    b.reflected = metallic_reflected(b.table, b.alpha, cosine);
    vec2 means = vec2(20.0, 1.0) / 21.0;
    if (!smooth_alpha(b.alpha)) means = microfacet_entry(b.table, b.alpha, float(COAT_COLUMNS - 1u));
    b.mean_let_in = let_in(b, means);
}

// Probabilities of the lobes, about in proportion to what they reflect: the coat's, the specular one, the diffuse one, and the one
// through a thin wall. All 0 where the material is black.
vec4 metallic_odds(Metallic b, vec3 wo) {
    float inner = has_coat(b) ? coat_lets_in(b, coat_cosine(b, wo)) : 1.0, base = inner * let_in(b, b.reflected);
    vec3 f = b.f0 * b.reflected.x + b.f90 * b.reflected.y;
    vec4 odds = vec4(1.0 - inner, inner * (dot(f, vec3(1.0 / 3.0)) + LEAST_ODDS * b.f90), base * dot(b.diffuse, vec3(1.0 / 3.0)),
                     base * dot(b.through, vec3(1.0 / 3.0)));
    return odds / max(odds.x + odds.y + odds.z + odds.w, 1e-10);
}

// Reflection by GGX microfacets without Fresnel factor: x = f cos, y = density per solid angle, z = cosine at the microfacet.
vec3 metallic_lobe(vec3 wo, vec3 wi, float alpha) {
    vec3 m = half_vector(wo, wi);
    float area = microfacet_area(true, wo, alpha);
    float density = microfacet_d(true, m, alpha) / (4.0 * area);
    float g = microfacet_g1(true, wo, alpha) * microfacet_g1(true, wi, alpha);
    return vec3(g * area / wo.z * density, density, clamp(dot(wo, m), 0.0, 1.0));
}

// rgb = f |cos wi|, w = density with which metallic_sample picks wi; both are above the horizon, or wi lies beyond a thin wall.
// The diffuse base is what appendix B calls fresnel_mix, but for its factor 1 - F at the half vector: with it, and a reflection
// of F(wo.z) at grazing angles, a white dielectric would give back up to 1.7 times the light that it gets. Here light passes the
// microfacets on its way in and out (Ashikhmin and Shirley 2000, with the albedo of rough microfacets in place of F), scaled by the
// mean of let_in so that the base gives back what it is let: in a white furnace a white dielectric neither loses nor gains. The
// clear coat takes its share on the way in and out, unscaled, since what is below it may reflect light into any direction.
vec4 metallic_evaluate(Metallic b, vec3 wo, vec3 wi) {
    bool beyond = wi.z < 0.0;
    if (beyond && !FX_THIN) return vec4(0.0);
    wi.z = abs(wi.z);
    vec4 odds = metallic_odds(b, wo);
    vec4 value = vec4(0.0);
    if (!beyond) {
        float enters = let_in(b, metallic_reflected(b.table, b.alpha, wi.z)), leaves = let_in(b, b.reflected);
        value = vec4(b.diffuse * (leaves * enters / max(b.mean_let_in, 1e-3)), odds.z) * (wi.z * INV_PI);
    }
    if (!smooth_alpha(b.alpha)) {
        vec3 lobe = metallic_lobe(wo, wi, b.alpha);
        vec3 f = beyond ? b.through * refracted(b, lobe.z) : mix(b.f0, vec3(b.f90), schlick_weight(lobe.z));
        value += vec4(f * lobe.x, (beyond ? odds.w : odds.y) * lobe.y);
    }
    if (!has_coat(b)) return value;
    value.rgb *= coat_lets_in(b, coat_cosine(b, wo)) * coat_lets_in(b, coat_cosine(b, wi));
    if (beyond || smooth_alpha(b.coat_alpha)) return value;
    if (FX_COAT_NORMALS) {
        mat3 frame = basis_from_normal(b.coat_normal);
        wo = wo * frame; // row vector times matrix: into the frame
        wi = wi * frame;
        if (min(wo.z, wi.z) <= GRAZING) return value;
    }
    vec3 lobe = metallic_lobe(wo, wi, b.coat_alpha);
    return value + vec4(vec3(b.coat * mix(COAT_F0, 1.0, schlick_weight(lobe.z)) * lobe.x), odds.x * lobe.y);
}

// Samples a direction. Returns false where the light is absorbed. A smooth lobe is a delta: then `weight` is its own, else it and
// the density are those of metallic_evaluate.
bool metallic_sample(Metallic b, vec3 wo, float u_lobe, vec2 u, out vec3 wi, out vec3 weight, out bool delta) {
    vec4 odds = metallic_odds(b, wo);
    bool coat = u_lobe < odds.x;
    bool through = !coat && FX_THIN && u_lobe < odds.x + odds.w;
    bool specular = !coat && !through && u_lobe < odds.x + odds.w + odds.y;
    wi = warp_cosine_hemisphere(u);
    weight = vec3(0.0);
    delta = false;
    if (!(coat || through || specular)) return true;
    float alpha = coat ? b.coat_alpha : b.alpha;
    delta = smooth_alpha(alpha);
    vec3 m = UP, seen = wo;
    mat3 frame = mat3(1.0);
    if (FX_COAT_NORMALS && coat) {
        frame = basis_from_normal(b.coat_normal);
        seen = wo * frame;
    }
    if (!delta) m = microfacet_sample(true, seen, alpha, u);
    wi = mirror(seen, m);
    bool above = wi.z > GRAZING;
    float inner = has_coat(b) ? coat_lets_in(b, coat_cosine(b, wo)) : 1.0, outer = inner;
    if (FX_COAT_NORMALS) {
        wi = frame * wi;
        above = above && wi.z > GRAZING;
        if (has_coat(b)) outer = coat_lets_in(b, coat_cosine(b, wi));
    }
    if (coat) weight = vec3((1.0 - inner) / odds.x);
    else weight = (through ? b.through * refracted(b, wo.z) : mix(b.f0, vec3(b.f90), schlick_weight(wo.z))) *
                  (inner * outer / max(through ? odds.w : odds.y, 1e-10));
    wi.z = through ? -wi.z : wi.z;
    return above;
}

// The probability of the lobe that metallic_sample chooses of several smooth ones; 1 of a single one, whatever a division makes of it.
float metallic_chance(Metallic b, vec3 wo, float u_lobe) {
    if (!has_coat(b) && b.through == vec3(0.0)) return 1.0;
    vec4 odds = metallic_odds(b, wo);
    if (u_lobe < odds.x) return odds.x;
    if (FX_THIN && u_lobe < odds.x + odds.w) return odds.w;
    return u_lobe < odds.x + odds.w + odds.y ? odds.y : odds.z;
}

// Approximate reflectance at the cosine `c`.
vec3 metallic_albedo(Metallic b, float c) {
    float inner = has_coat(b) ? coat_lets_in(b, c) : 1.0;
    vec2 reflected = metallic_reflected(b.table, b.alpha, c);
    vec3 albedo = (b.diffuse + b.through) * let_in(b, reflected) + b.f0 * reflected.x + b.f90 * reflected.y;
    return albedo * inner + 1.0 - inner;
}

// Share of the light head on that the surface reflects, of all that comes back.
float metallic_specular(Metallic b) {
    float f0 = dot(b.f0, vec3(1.0)), base = dot(b.diffuse + b.through, vec3(1.0));
    return f0 / max(f0 + base, 1e-10);
}

// Whether every lobe is a delta.
bool metallic_is_delta(Metallic b) {
    return smooth_alpha(b.alpha) && b.diffuse == vec3(0.0) && (!has_coat(b) || smooth_alpha(b.coat_alpha));
}
