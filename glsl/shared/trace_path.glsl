// The light that comes along a path: next event estimation and BSDF sampling joined by the balance heuristic (Veach 1997). Needs
// `push` (PathPush), and sampler.glsl, traverse.glsl, surface.glsl and light.glsl before it.

// Rays so far that look for the closest hit, and for any hit.
uint closest_rays = 0u, any_rays = 0u;

// Dimension pairs of the sampler: the camera uses the first two, every scattering event these.
const uint PAIR_FIRST_BOUNCE = 2u, PAIRS_PER_BOUNCE = 4u;
const uint PAIR_CHOICE = 0u, PAIR_LIGHT = 1u, PAIR_BSDF = 2u, PAIR_ROULETTE = 3u;

// Shadow rays to a lamp end at this share of the distance, since the distance at which they would hit the lamp has an error of
// about 2^-24 over the cosine there.
const float SHADOW_END = 0.99999;

const float MAX_SURVIVAL = 0.95; // largest survival probability of roulette

// Weight of the strategy that was used, by the balance heuristic. Two densities of 0 give 0, not 0 / 0.
float balance(float taken, float other) { return taken / max(taken + other, 1e-37); }

struct Path {
    vec3 origin;
    vec3 direction;
    vec3 throughput;
    float bsdf_pdf; // of `direction`, per steradian; 0 after a smooth interface or from the camera
    bool delta;     // light sampling cannot produce `direction`: no MIS weight
    float eta_scale; // squared refractive index at `origin` over that at the camera
};

struct SplitLight {
    vec3 direct;
    vec3 indirect;
    vec3 soft; // with FX_SOFT what lamps and sky bring to the first hit, until the path's end; else zero
};

const uint DIRECT = 0u, INDIRECT = 1u, SOFT = 2u;

void add_light(inout SplitLight sum, vec3 light, uint kind) {
    bool indirect = FX_INDIRECT && kind == INDIRECT, soft = FX_SOFT && kind == SOFT;
    sum.direct += indirect || soft ? vec3(0.0) : light;
    sum.indirect += indirect ? light : vec3(0.0);
    sum.soft += soft ? light : vec3(0.0);
}

// What light is that comes to a path by way of `scattered` surfaces that are not smooth. Smooth ones show light as it is, with
// noise where `chosen`: where the path took one of two ways.
uint kind_of_light(uint scattered, bool delta, bool chosen) {
    if (scattered == 0u) return chosen ? SOFT : DIRECT;
    return scattered >= 2u ? INDIRECT : delta ? DIRECT : SOFT;
}

// Clamps the largest channel of a whole sample, not of each bounce: the limit is that of the values which a pixel averages.
vec3 clamped(vec3 light) {
    float largest = max(light.r, max(light.g, light.b));
    return light * (push.constants.clamp_indirect > 0.0 && largest > push.constants.clamp_indirect ? push.constants.clamp_indirect / largest : 1.0);
}

vec3 light_from_miss(Path path) {
    if (!FX_ENVIRONMENT || push.constants.environment == NONE) return vec3(0.0);
    float pdf;
    vec3 radiance = environment_radiance(path.direction, pdf);
    return radiance * (path.delta ? 1.0 : balance(path.bsdf_pdf, pdf));
}

vec3 light_from_hit(Path path, Surface s, float t) {
    float cosine = -dot(s.geometric, path.direction);
    float weight = path.delta ? 1.0 : balance(path.bsdf_pdf, triangle_light_pdf(s, path.origin, t, cosine));
    return FX_EMISSIVE && cosine > 0.0 ? surface_emission(s) * weight : vec3(0.0);
}

// Direct light at `s` by light sampling, which counts if nothing blocks `shadow`; where it is 0, no ray is needed. The columns
// of `basis` are the shading frame.
vec3 light_from_nee(Surface s, Bsdf bsdf, Facing facing, mat3 basis, vec3 wo, Sampler random, uint pair, uint mask_seed,
                    out Segment shadow, out bool delta) {
    uint word = sample_2d_bits(random, pair + PAIR_CHOICE).x;
    LightSample light = light_sample(s.position, word, sample_2d(random, pair + PAIR_LIGHT));
    delta = light.pdf == 0.0;
    vec3 wi = light.direction * basis; // row vector times matrix: into the frame
    vec4 f = bsdf_evaluate(bsdf, wo, wi);
    f.rgb *= light_share(s, facing, light.direction, wi.z);
    shadow = Segment(ray_origin(s, light.direction), light.direction, light.distance, mask_seed);
    if (light.distance < INFINITE_DISTANCE) { // aim again from the offset origin, so that the segment ends on the light
        shadow.direction = s.position + light.distance * light.direction - shadow.origin;
        shadow.t_max = SHADOW_END;
    }
    return f.rgb * light.radiance * (light.pdf > 0.0 ? balance(light.pdf, f.w) : 1.0);
}

// Samples the next direction. Returns false when the path ends.
bool scatter(inout Path path, Surface s, Bsdf bsdf, Facing facing, mat3 basis, vec3 wo, Sampler random, uint pair) {
    BsdfSample next;
    float lobe = sample_2d(random, pair + PAIR_CHOICE).y;
    bool scattered = bsdf_sample(bsdf, wo, lobe, sample_2d(random, pair + PAIR_BSDF), next);
    path.direction = basis * next.wi;
    path.throughput *= next.weight * light_share(s, facing, path.direction, next.wi.z);
    path.origin = ray_origin(s, path.direction);
    path.bsdf_pdf = next.pdf;
    path.delta = next.delta;
    if (FX_ROULETTE && is_kind(FX_DIELECTRIC, bsdf, BSDF_DIELECTRIC) && wo.z * next.wi.z < 0.0) {
        float eta = relative_index(bsdf, wo.z);
        path.eta_scale *= eta * eta;
    }
    return scattered && max(path.throughput.r, max(path.throughput.g, path.throughput.b)) > 0.0;
}

// Russian roulette. The survival probability leaves out the factors 1 / eta^2 that refraction scales radiance by, since they
// cancel when the path leaves the glass.
bool survives_roulette(inout Path path, Sampler random, uint pair) {
    float q = min(max(path.throughput.r, max(path.throughput.g, path.throughput.b)) * path.eta_scale, MAX_SURVIVAL);
    if (sample_2d(random, pair + PAIR_ROULETTE).x >= q) return false;
    path.throughput /= q;
    return true;
}

// Adds the light that the path meets at `hit`. Returns true where the path can continue from the surface `s`.
bool arrive(inout SplitLight sum, Path path, Hit hit, uint kind, out Surface s) {
    if (hit.triangle == NONE) {
        add_light(sum, path.throughput * light_from_miss(path), kind);
        return false;
    }
    s = surface_at(hit);
    add_light(sum, path.throughput * light_from_hit(path, s, hit.t), kind);
    return true;
}

// The light of a path whose first ray has found `hit`. One that is not `on` keeps the other lanes company where triangles are dealt.
// One that is `sharp_only` ends where no light but such as a filter takes can come any more: the filter fills that in.
SplitLight trace_path(Path path, bool on, bool sharp_only, Hit hit, Sampler random, uint seed, out vec3 albedo) {
    SplitLight sum = SplitLight(vec3(0.0), vec3(0.0), vec3(0.0));
    albedo = vec3(0.0);
    closest_rays++;
    Surface s;
    uint bounce = 0u, scattered = 0u;
    bool chosen = false;
    // A turn of the loop leads from one surface to the next; the last surface samples no light. Light sampled at a surface is
    // added only once its shadow ray is traced, together with the ray to the next surface: see trace_shadow_then_closest.
    bool going = arrive(sum, path, hit, DIRECT, s) && push.constants.max_depth > 1u && on;
    if (any_lane(going)) do {
        uint pair = PAIR_FIRST_BOUNCE + PAIRS_PER_BOUNCE * bounce;
        Bsdf bsdf = surface_bsdf(s);
        // The normal of a dielectric stays on its outside, since its two sides differ.
        bool turns = (s.flags & MATERIAL_TWO_SIDED) != 0u && !is_kind(FX_DIELECTRIC, bsdf, BSDF_DIELECTRIC);
        Facing facing = facing_normals(s, -path.direction, turns, bsdf_is_specular(bsdf));
        if (is_kind(FX_METALLIC, bsdf, BSDF_METALLIC))
            facing = facing_of_metal(s, facing, -path.direction, metallic_specular(bsdf.metallic));
        mat3 basis = shading_basis(s, bsdf, facing.normal);
        vec3 wo = -path.direction * basis;
        if (FX_COAT_NORMALS) bsdf.metallic.coat_normal = local_coat_normal(s, facing, basis, wo);
        bsdf_view(bsdf, wo);
        bool smooth_here = bsdf_is_delta(bsdf);
        if (scattered == 0u && !chosen && going) {
            chosen = smooth_here && bsdf_chooses(bsdf);
            albedo = min(path.throughput, vec3(1.0)) * (chosen ? vec3(1.0) : bsdf_albedo(bsdf, wo.z)); // roulette may exceed 1
        }
        Segment shadow;
        uint mask_seed = pcg(seed + 2u * bounce);
        bool delta;
        vec3 sampled = path.throughput * light_from_nee(s, bsdf, facing, basis, wo, random, pair, mask_seed + 1u, shadow, delta);
        bool shadowed = going && push.constants.light_count > 0u && !smooth_here && max(sampled.r, max(sampled.g, sampled.b)) > 0.0;
        bool alive = scatter(path, s, bsdf, facing, basis, wo, random, pair) && going;
        scattered += smooth_here ? 0u : 1u;
        // From here on comes nothing but what a filter takes; with FX_SOFT already from the first surface, but for its delta lights.
        bool ends = FX_SPARSE && sharp_only && scattered > (FX_SOFT ? 0u : 1u);
        shadowed = shadowed && (!ends || (FX_SOFT && delta));
        alive = alive && !ends;
        bool roulette = FX_ROULETTE && push.constants.roulette_depth > 0u && bounce + 1u >= push.constants.roulette_depth;
        if (roulette) alive = survives_roulette(path, random, pair) && alive;
        bounce++;
        if (!DEALT && !alive && !shadowed) break;

        closest_rays += uint(alive);
        any_rays += uint(shadowed);
        bool lit = shadowed;
        Segment ray = Segment(path.origin, path.direction, INFINITE_DISTANCE, pcg(seed + 2u * bounce));
        uvec2 from = uvec2(hit.triangle, hit.instance);
        if (DEALT) hit = deal_shadow_then_closest(shadow, shadowed, ray, alive, push.constants.root, from);
        else hit = trace_shadow_then_closest(shadow, shadowed, ray, alive, push.constants.root, from);
        add_light(sum, lit && !shadowed ? sampled : vec3(0.0), kind_of_light(scattered, delta, chosen));
        going = alive && arrive(sum, path, hit, kind_of_light(scattered, false, chosen), s);
        going = going && bounce + 1u < push.constants.max_depth;
    } while (any_lane(going));
    if (FX_CLAMP) sum.indirect = clamped(sum.indirect);
    if (FX_SOFT) sum.indirect += sum.soft;
    if (FX_SPARSE && sharp_only) sum.indirect = vec3(0.0);
    return sum;
}
