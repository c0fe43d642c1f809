// A path's way from one surface to the next: next event estimation and BSDF sampling joined by the balance heuristic (Veach 1997).
// Needs `push` (PathPush).
#include "shared/largest_channel.glsl"
#include "shared/sampler.glsl"
#include "shared/surface.glsl"
#include "shared/light.glsl"
#include "shared/path_state.glsl"

// Dimension pairs of the sampler: the camera uses the first two, every scattering event these.
const uint PAIR_FIRST_BOUNCE = 2u, PAIRS_PER_BOUNCE = 4u;
const uint PAIR_CHOICE = 0u, PAIR_LIGHT = 1u, PAIR_BSDF = 2u, PAIR_ROULETTE = 3u;

// Shadow rays to a lamp end at this share of the distance, since the distance at which they would hit the lamp has an error of
// about 2^-24 over the cosine there.
const float SHADOW_END = 0.99999;

const float ODDS_BEYOND_COSINE = 0.05; // see Receiver: for lobes that reflect much at grazing angles

const float LEAST_REST = 0.01; // share of what lobes reflect that the odds of lights take to go by the cosine, at least

const float MAX_SURVIVAL = 0.95; // largest survival probability of roulette

// Weight of the strategy that was used, by the balance heuristic. Two densities of 0 give 0, not 0 / 0.
float balance(float taken, float other) { return taken / max(taken + other, 1e-37); }

vec3 light_from_miss(Path path) {
    if (!FX_ENVIRONMENT || push.constants.environment == NONE) return vec3(0.0);
    float pdf;
    vec3 radiance = environment_radiance(path.direction, pdf);
    return radiance * (path.delta ? 1.0 : balance(path.bsdf_pdf, pdf));
}

vec3 light_from_hit(Path path, Surface s, float t) {
    float cosine = -dot(s.geometric, path.direction);
    bool front = cosine > 0.0, shines = front || (FX_TWO_SIDED_LAMPS && (s.flags & MATERIAL_EMITS_BEHIND) != 0u);
    bool certain = path.delta || (FX_SPHERES && s.radius > 0.0 && !front); // light sampling does not choose a sphere's inside
    float weight = certain ? 1.0 : balance(path.bsdf_pdf, triangle_light_pdf(s, path.origin, t, abs(cosine)));
    return FX_EMISSIVE && shines ? surface_emission(s, abs(cosine)) * weight : vec3(0.0);
}

// By the probability of the lobe around the mirror image it is weighed against the others, as if these were diffuse: f cosine of the one is
// its share D / (4 area), of the others theirs cosine / pi.
Receiver receiver_of(Surface s, Bsdf bsdf, View view) {
    float beyond_cosine = is_kind(FX_DIFFUSE, bsdf, BSDF_DIFFUSE) ? 0.0 : ODDS_BEYOND_COSINE;
    Receiver r = Receiver(s.position, view.facing.normal, bsdf_lets_light_through(bsdf), beyond_cosine, UP, 0.0, 1.0);
    if (FX_ROUGH) {
        vec2 lobe = bsdf_gloss(bsdf, view.wo);
        float cosine = abs(view.wo.z);
        r.viewer = view.basis * view.wo;
        r.alpha2 = max(lobe.y * lobe.y, 1e-6);
        float area = 0.5 * (cosine + sqrt(mix(r.alpha2, 1.0, cosine * cosine)));
        r.gloss = lobe.x / (4.0 * area * max(1.0 - lobe.x, LEAST_REST));
    }
    return r;
}

// Direct light at `s` by light sampling, which counts if nothing blocks `d.shadow`; where it is 0, no ray is needed. Sets what a departure
// knows of the light.
vec3 light_from_nee(Surface s, Bsdf bsdf, View view, Sampler random, uint pair, uint mask_seed, inout Departure d) {
    uint word = sample_2d_bits(random, pair + PAIR_CHOICE).x;
    LightSample light = light_sample(receiver_of(s, bsdf, view), word, sample_2d(random, pair + PAIR_LIGHT));
    d.certainty = light.sharp;
    d.chosen = light.chosen;
    d.kept = light.chosen == light.key ? light.kept * light.sharp : 0.0;
    d.passed_over = light.kept > 0.0 && light.chosen != light.key;
    vec3 wi = light.direction * view.basis; // row vector times matrix: into the frame
    vec4 f = bsdf_evaluate(bsdf, view.wo, wi);
    f.rgb *= light_share(s, view.facing, light.direction, wi.z);
    mask_seed |= light.pdf == 0.0 ? PASSES_WALLS : 0u;
    Segment shadow = Segment(ray_origin(s, light.direction), light.direction, light.distance, mask_seed);
    if (light.distance < INFINITE_DISTANCE) { // aim again from the offset origin, so that the segment ends on the light
        shadow.direction = s.position + light.distance * light.direction - shadow.origin;
        shadow.t_max = SHADOW_END;
    }
    d.shadow = shadow;
    return f.rgb * light.radiance * (light.pdf > 0.0 ? balance(light.pdf, f.w) : 1.0);
}

// Samples the next direction. Returns false when the path ends.
bool scatter(inout Path path, Surface s, Bsdf bsdf, View view, Sampler random, uint pair) {
    BsdfSample next;
    float lobe = sample_2d(random, pair + PAIR_CHOICE).y;
    bool scattered = bsdf_sample(bsdf, view.wo, lobe, sample_2d(random, pair + PAIR_BSDF), next);
    path.direction = view.basis * next.wi;
    path.throughput *= next.weight * light_share(s, view.facing, path.direction, next.wi.z);
    path.origin = ray_origin(s, path.direction);
    path.bsdf_pdf = next.pdf;
    path.delta = next.delta;
    if (FX_ROULETTE && is_kind(FX_DIELECTRIC, bsdf, BSDF_DIELECTRIC) && view.wo.z * next.wi.z < 0.0) {
        float eta = relative_index(bsdf, view.wo.z);
        path.eta_scale *= eta * eta;
    }
    return scattered && largest_channel(path.throughput) > 0.0;
}

// Russian roulette. The survival probability leaves out the factors 1 / eta^2 that refraction scales radiance by, since they
// cancel when the path leaves the glass.
bool survives_roulette(inout Path path, Sampler random, uint pair) {
    float q = min(largest_channel(path.throughput) * path.eta_scale, MAX_SURVIVAL);
    if (sample_2d(random, pair + PAIR_ROULETTE).x >= q) return false;
    path.throughput /= q;
    return true;
}

// Adds the light that the path meets at its hit. Returns whether it can go on from the surface `s`: the last one samples no light.
bool arrive(inout PathState p, out Surface s) {
    uint kind = kind_of_light(p.scattered, p.share < 1.0);
    if (p.hit.triangle == NONE) {
        add_light(p.light, p.path.throughput * light_from_miss(p.path), kind);
        return false;
    }
    s = surface_at(p.hit);
    add_light(p.light, p.path.throughput * light_from_hit(p.path, s, p.hit.t), kind);
    return p.bounce + 1u < push.constants.max_depth;
}

// Scatters light at the surface `s`, where the path is `going`. Light sampled there is added once its shadow ray is traced, by
// `add_sampled`, and together with what the next ray meets.
Departure leave(inout PathState p, Surface s, bool going, Sampler random) {
    Departure d;
    uint pair = PAIR_FIRST_BOUNCE + PAIRS_PER_BOUNCE * p.bounce;
    Bsdf bsdf = surface_bsdf(s);
    View view = view_of(s, bsdf, facing_of(s, bsdf, -p.path.direction), -p.path.direction);
    bool smooth_here = bsdf_is_delta(bsdf);
    bool sees = p.scattered == 0u && p.share > 0.0 && going;
    if (sees) p.albedo = seen_albedo(p.path.throughput, bsdf_albedo(bsdf, view.wo.z), p.share);
    uint seed = shadow_mask_seed(p.seed, p.bounce);
    d.sampled = p.path.throughput * light_from_nee(s, bsdf, view, random, pair, seed, d);
    if (FX_SOFT && going && p.scattered == 0u && !smooth_here) p.passed_over = d.passed_over;
    d.shadowed = going && push.constants.light_count > 0u && !smooth_here && largest_channel(d.sampled) > 0.0;
    d.alive = scatter(p.path, s, bsdf, view, random, pair) && going;
    if (sees && smooth_here && d.alive) {
        p.share *= bsdf_share(bsdf, view.wo, sample_2d(random, pair + PAIR_CHOICE).y);
        if (p.share < 1.0) p.albedo = seen_albedo(p.path.throughput, vec3(1.0), 1.0);
    }
    p.scattered += smooth_here ? 0u : 1u;
    // From here on comes nothing but what a filter takes; with FX_SOFT already from the first surface, but for the key light there.
    bool ends = FX_SPARSE && p.sharp_only && p.scattered > (FX_SOFT ? 0u : 1u);
    d.shadowed = d.shadowed && (!ends || (FX_SOFT && d.kept > 0.0));
    d.alive = d.alive && !ends;
    bool roulette = FX_ROULETTE && push.constants.roulette_depth > 0u && p.bounce + 1u >= push.constants.roulette_depth;
    if (roulette) d.alive = survives_roulette(p.path, random, pair) && d.alive;
    p.bounce++;
    p.closest_rays += uint(d.alive);
    p.any_rays += uint(d.shadowed);
    return d;
}
