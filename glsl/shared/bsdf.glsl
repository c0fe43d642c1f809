// Scattering at a surface point. Local frame: z = shading normal on the front side. `wo` points to the camera, `wi` to the
// light; both leave the surface. Radiance is transported: refraction scales it by 1 / eta^2.
// Needs effects.glsl and the binding `texels`, which holds the tables of rough coats and metallic microfacets.
#include "shared/warp.glsl"
#include "shared/largest_channel.glsl"
#include "shared/fresnel.glsl"
#include "shared/microfacet.glsl"
#include "shared/metallic.glsl"

// A material resolved at the hit. Members as in Material.
struct Bsdf {
    uint kind;
    vec3 albedo;
    float alpha;
    float stretch; // roughness along y over alpha, that along x
    vec3 eta;
    vec3 k;
    vec3 specular;
    vec3 transmission;
    float internal_fresnel;
    uint coat_table;
    bool nonlinear;
    bool ggx;
    Metallic metallic; // all that BSDF_METALLIC is evaluated by
    // bsdf_view computes these once for a coat:
    float coat_row;     // of the table at this roughness
    float coat_outside; // the share of light from the viewer that the coat does not let in
    float coat_inside;  // the mean share that it reflects of light from inside
};

// A sampled direction: weight = f |cos| / pdf. A delta lobe has pdf 0, and its weight includes the probability of the lobe.
struct BsdfSample {
    vec3 wi;
    vec3 weight;
    float pdf;
    bool delta;
};


// With one kind of material in the scene, the compiler removes the test for it.
const bool ONE_KIND = uint(FX_DIFFUSE) + uint(FX_CONDUCTOR) + uint(FX_DIELECTRIC) + uint(FX_COATED) + uint(FX_METALLIC) == 1u;

bool is_kind(bool effect, Bsdf b, uint kind) {
    return effect && (ONE_KIND || b.kind == kind);
}

bool is_smooth(Bsdf b) {
    return smooth_alpha(b.alpha);
}

// Microfacets whose roughness depends on the direction are those of roughness alpha, drawn out along y: Heitz 2014,
// "Understanding the masking-shadowing function in microfacet-based BRDFs", section 5.3. Seen from there, a direction is:
vec3 undrawn(Bsdf b, vec3 w) {
    return FX_ANISOTROPIC ? vec3(w.x, w.y * b.stretch, w.z) : w;
}

// D(m) of the microfacets, per steradian.
float facet_density(Bsdf b, vec3 m) {
    if (!FX_ANISOTROPIC) return microfacet_d(b.ggx, m, b.alpha);
    return microfacet_d(b.ggx, vec3(m.x, m.y / b.stretch, m.z), b.alpha) / b.stretch;
}

// A normal visible from w.
vec3 facet_sample(Bsdf b, vec3 w, vec2 u) {
    vec3 m = microfacet_sample(b.ggx, undrawn(b, w), b.alpha, u);
    return FX_ANISOTROPIC && b.stretch != 1.0 ? normalize(undrawn(b, m)) : m;
}

float mean3(vec3 v) {
    return (v.x + v.y + v.z) * (1.0 / 3.0);
}

vec4 evaluate_diffuse(Bsdf b, vec3 wi) {
    return vec4(b.albedo, 1.0) * (wi.z * INV_PI);
}

// Shadowing and masking of a sample drawn by visible normals: G1(wo) G1(wi) area(wo) / wo.z. It equals G1(wi) up to 0.4 %, the
// difference of Walter's fit of the Beckmann G1, which f uses, and the exact G1, by which the pdf integrates to 1.
float visible_weight(Bsdf b, vec3 wo, vec3 wi, float area) {
    vec3 from = undrawn(b, wo), to = undrawn(b, vec3(wi.xy, abs(wi.z)));
    float g = microfacet_g1(b.ggx, from, b.alpha) * microfacet_g1(b.ggx, to, b.alpha);
    return g * area / wo.z;
}

// Refractive index beyond the interface over that on the side of wo. For a rough interface 1 becomes 1.001, since equal indices
// refract into a single direction; that bends light by less than the smallest alpha.
float relative_index(Bsdf b, float wo_z) {
    float eta = !is_smooth(b) && abs(b.eta.x - 1.0) < 1e-3 ? 1.001 : b.eta.x;
    return wo_z < 0.0 ? 1.0 / eta : eta;
}

// Density of wi over solid angle times area(wo), for the visible normal m and n = index on wi's side / on wo's
// (Walter et al. 2007, eq. 17; with n = 1 it is eq. 14). `co` = wo.m, `ci` = wi.m.
float scattered_density(Bsdf b, vec3 m, float n, float co, float ci) {
    float q = co + n * ci;
    return facet_density(b, m) * co * abs(ci) * n * n / max(q * q, 1e-30);
}

// Probability of sampling the coat's reflection: approximately its share of the reflected energy.
float coat_probability(Bsdf b, float f) {
    float specular = f * mean3(b.specular);
    return specular / max(specular + (1.0 - f) * mean3(b.albedo), 1e-10);
}

// Interpolates the coat's table. `column` may lie between two columns of cosines. Twin: src/twins/coat.rs.
float coat_entry(Bsdf b, float column) {
    TableCell cell = table_cell(b.coat_table, b.coat_row, column);
    vec4 corners = uintBitsToFloat(cell.words);
    vec2 along = mix(corners.xy, corners.zw, cell.within.y);
    return mix(along.x, along.y, cell.within.x);
}

// The share of light at cosine `c` that the coat does not let in.
float coat_outside(Bsdf b, float c) {
    if (is_smooth(b)) return fresnel_dielectric(c, b.eta.x).x;
    return coat_entry(b, table_column(c));
}

// Must be called before a material is evaluated or sampled.
void bsdf_view(inout Bsdf b, vec3 wo) {
    if (is_kind(FX_METALLIC, b, BSDF_METALLIC)) metallic_view(b.metallic, wo.z);
    if (!is_kind(FX_COATED, b, BSDF_COATED)) return;
    b.coat_row = table_row(b.alpha);
    b.coat_outside = coat_outside(b, wo.z);
    b.coat_inside = is_smooth(b) ? b.internal_fresnel : coat_entry(b, float(COAT_COLUMNS - 1u));
}

// Mitsuba 3's `plastic` and `roughplastic`: light enters and leaves through the interface. The light that it reflects back
// inwards, again and again, adds the factor 1 / (1 - mean inner reflectance), which `nonlinear` multiplies by the base's colour.
// Returns in rgb the factor of the diffuse base, in w the probability of the coat's lobe.
vec4 coat(Bsdf b, vec3 wi) {
    float fo = b.coat_outside;
    float fi = coat_outside(b, wi.z);
    vec3 back = b.nonlinear ? b.albedo * b.coat_inside : vec3(b.coat_inside);
    return vec4((1.0 - fo) * (1.0 - fi) / (b.eta.x * b.eta.x * (1.0 - back)), coat_probability(b, fo));
}

// Returns rgb = f |cos wi| and w = the density over solid angle with which bsdf_sample picks wi. Delta lobes count as 0. All
// kinds of material share code, since a device that masks lanes runs the branches of all kinds.
vec4 bsdf_evaluate(Bsdf b, vec3 wo, vec3 wi) {
    bool glass = is_kind(FX_DIELECTRIC, b, BSDF_DIELECTRIC), metal = is_kind(FX_CONDUCTOR, b, BSDF_CONDUCTOR);
    bool coated = is_kind(FX_COATED, b, BSDF_COATED);
    if (is_kind(FX_METALLIC, b, BSDF_METALLIC)) return min(wo.z, abs(wi.z)) > GRAZING ? metallic_evaluate(b.metallic, wo, wi) : vec4(0.0);
    float eta = glass ? relative_index(b, wo.z) : b.eta.x;
    if (glass) { // on the side of wo: both z flip together when wo is inside
        wi.z = wo.z < 0.0 ? -wi.z : wi.z;
        wo.z = abs(wo.z);
    }
    if (wo.z <= GRAZING || (glass ? abs(wi.z) : wi.z) <= GRAZING) return vec4(0.0);
    vec4 value = glass || metal ? vec4(0.0) : evaluate_diffuse(b, wi);
    float share = 1.0; // probability that bsdf_sample takes this lobe
    if (coated) {
        vec4 c = coat(b, wi);
        value *= vec4(c.xyz, 1.0 - c.w);
        share = c.w;
    }
    if (!(glass || metal || coated) || is_smooth(b)) return value;
    bool reflected = wi.z > 0.0;
    float n = reflected ? 1.0 : eta;
    vec3 m = half_vector(wo, n * wi);
    m = m.z < 0.0 ? -m : m;
    float co = dot(wo, m), ci = dot(wi, m);
    if (co <= 0.0 || ci * wi.z <= 0.0) return value;
    vec3 tint = reflected ? b.specular : b.transmission;
    if (metal) {
        tint *= fresnel_conductor(co, b.eta, b.k);
    } else {
        float f = fresnel_dielectric(co, eta).x;
        if (glass) share = reflected ? f : 1.0 - f;
        tint *= glass ? share : f;
    }
    float area = microfacet_area(b.ggx, undrawn(b, wo), b.alpha);
    float density = scattered_density(b, m, n, co, ci) / area;
    return value + vec4(tint * (visible_weight(b, wo, wi, area) * density / (n * n)), share * density);
}

bool sample_metallic(Bsdf b, vec3 wo, float u_lobe, vec2 u, out BsdfSample s) {
    s.pdf = 0.0;
    if (!metallic_sample(b.metallic, wo, u_lobe, u, s.wi, s.weight, s.delta)) return false;
    if (s.delta) return true;
    vec4 value = bsdf_evaluate(b, wo, s.wi);
    s.weight = value.rgb / max(value.w, 1e-30);
    s.pdf = value.w;
    return value.w > 0.0;
}

// Samples a direction: `u_lobe` chooses the lobe, `u` the direction in it. Returns false where the light is absorbed; `s` is
// then undefined.
bool bsdf_sample(Bsdf b, vec3 wo, float u_lobe, vec2 u, out BsdfSample s) {
    bool glass = is_kind(FX_DIELECTRIC, b, BSDF_DIELECTRIC), metal = is_kind(FX_CONDUCTOR, b, BSDF_CONDUCTOR);
    bool coated = is_kind(FX_COATED, b, BSDF_COATED);
    vec3 wi = warp_cosine_hemisphere(u);
    s = BsdfSample(wi, b.albedo, wi.z * INV_PI, false);
    if (!glass && wo.z <= GRAZING) return false;
    if (is_kind(FX_METALLIC, b, BSDF_METALLIC)) return sample_metallic(b, wo, u_lobe, u, s);
    if (!(glass || metal || coated)) return true;
    s.delta = is_smooth(b);
    float side = wo.z < 0.0 ? -1.0 : 1.0;
    vec3 above = vec3(wo.xy, side * wo.z), m = UP;
    if (!s.delta) m = facet_sample(b, above, u);
    float co = dot(above, m), ci = co, n = 1.0;
    float eta = glass ? relative_index(b, wo.z) : b.eta.x;
    bool specular = true, reflected = true;
    s.weight = b.specular;
    if (metal) {
        s.weight *= fresnel_conductor(co, b.eta, b.k);
    } else {
        vec2 f = fresnel_dielectric(coated ? above.z : co, eta);
        if (coated) f.x = b.coat_outside;
        float p = coated ? coat_probability(b, f.x) : f.x;
        bool first = u_lobe < p;
        if (coated) {
            specular = first;
            s.weight *= f.x / max(p, 1e-10);
        } else {
            reflected = first;
            n = reflected ? 1.0 : eta;
            ci = reflected ? co : -f.y;
            s.weight = (reflected ? b.specular : b.transmission) / (n * n);
        }
    }
    if (specular) wi = (co / n + ci) * m - above / n;
    s.wi = vec3(wi.xy, side * wi.z);
    s.delta = s.delta && specular;
    s.pdf = 0.0;
    bool scattered = above.z >= GRAZING && (reflected ? wi.z > GRAZING : wi.z < -GRAZING) && (co > 0.0 || !specular);
    if (scattered && !s.delta) {
        vec4 value = bsdf_evaluate(b, wo, s.wi);
        s.weight = value.rgb / max(value.w, 1e-30);
        s.pdf = value.w;
    }
    return scattered;
}

// Whether light scatters at the surface alone: conductors and dielectrics.
bool is_interface(Bsdf b) { return is_kind(FX_CONDUCTOR, b, BSDF_CONDUCTOR) || is_kind(FX_DIELECTRIC, b, BSDF_DIELECTRIC); }

// Whether there is a lobe around the mirror image of `wo`.
bool bsdf_is_specular(Bsdf b) {
    return is_interface(b) || is_kind(FX_COATED, b, BSDF_COATED) || is_kind(FX_METALLIC, b, BSDF_METALLIC);
}

// The lobe of rough microfacets around the mirror image of `wo`: x is the probability that bsdf_sample takes it, y its roughness, the
// greater of two. A clear coat's lobe does not count.
vec2 bsdf_gloss(Bsdf b, vec3 wo) {
    if (is_kind(FX_METALLIC, b, BSDF_METALLIC))
        return vec2(smooth_alpha(b.metallic.alpha) ? 0.0 : metallic_odds(b.metallic, wo).y, b.metallic.alpha);
    float share = 0.0;
    if (is_kind(FX_CONDUCTOR, b, BSDF_CONDUCTOR)) share = 1.0;
    if (is_kind(FX_DIELECTRIC, b, BSDF_DIELECTRIC)) share = fresnel_dielectric(abs(wo.z), relative_index(b, wo.z)).x;
    if (is_kind(FX_COATED, b, BSDF_COATED)) share = coat_probability(b, b.coat_outside);
    return vec2(is_smooth(b) ? 0.0 : share, b.alpha * max(b.stretch, 1.0));
}

// Whether every lobe is a delta: light samples cannot contribute, and what is behind the surface is seen in it.
bool bsdf_is_delta(Bsdf b) {
    return is_kind(FX_METALLIC, b, BSDF_METALLIC) ? metallic_is_delta(b.metallic) : is_interface(b) && is_smooth(b);
}

// The probability of the way that bsdf_sample chooses by `u_lobe`, where every lobe is a delta: 1 where light has one way alone, and 0 of
// a way less likely than not.
float bsdf_share(Bsdf b, vec3 wo, float u_lobe) {
    float chance = 1.0;
    if (is_kind(FX_METALLIC, b, BSDF_METALLIC)) {
        chance = metallic_chance(b.metallic, wo, u_lobe);
    } else if (is_kind(FX_DIELECTRIC, b, BSDF_DIELECTRIC)) {
        float reflected = fresnel_dielectric(abs(wo.z), relative_index(b, wo.z)).x;
        chance = u_lobe < reflected ? reflected : 1.0 - reflected;
    }
    return chance < 0.5 ? 0.0 : chance;
}

const float LEAST_TINT = 0.3;

// The albedo that a path of this `throughput` keeps of a surface. Where it came a way that it takes with the probability `share`, what
// lies the other way counts as white. Roulette may leave a throughput above 1. Deep colours count as LEAST_TINT of their strongest channel
// at least: what reaches the eye from there by other ways does not have them, and would glow if it were divided by them.
vec3 seen_albedo(vec3 throughput, vec3 albedo, float share) {
    vec3 tint = min(throughput, vec3(1.0));
    return max(tint, vec3(LEAST_TINT * largest_channel(tint))) * mix(vec3(1.0), albedo, share);
}

// Whether some lobe leaves on the other side.
bool bsdf_lets_light_through(Bsdf b) {
    if (is_kind(FX_METALLIC, b, BSDF_METALLIC)) return b.metallic.through != vec3(0.0);
    return is_kind(FX_DIELECTRIC, b, BSDF_DIELECTRIC);
}

// Approximate reflectance at the cosine `wo_z`: light is divided by it before it is filtered. Mirrors and clear glass, which show
// what is behind them, have none of their own.
vec3 bsdf_albedo(Bsdf b, float wo_z) {
    if (bsdf_is_delta(b)) return vec3(0.0);
    bool glass = is_kind(FX_DIELECTRIC, b, BSDF_DIELECTRIC), metal = is_kind(FX_CONDUCTOR, b, BSDF_CONDUCTOR);
    bool coated = is_kind(FX_COATED, b, BSDF_COATED);
    if (is_kind(FX_METALLIC, b, BSDF_METALLIC)) return metallic_albedo(b.metallic, abs(wo_z));
    if (!(glass || metal || coated)) return b.albedo;
    if (metal) return b.specular * fresnel_conductor(abs(wo_z), b.eta, b.k);
    float f = fresnel_dielectric(abs(wo_z), glass ? relative_index(b, wo_z) : b.eta.x).x;
    return mix(glass ? b.transmission : b.albedo, b.specular, f);
}
