// Paths that wait between the kernels of a wavefront: words of one kind of all paths lie together, so that neighbouring threads read
// neighbouring words.
#include "shared/path_state.glsl"
#include "shared/which_path.glsl"
layout(scalar, binding = 16) buffer Memory { uvec4 memory[]; };

// What is kept of a path: a vector, and with it a word.
const uint ORIGIN = 0u;         // density of the direction
const uint DIRECTION = 1u;      // scale of the refractive index
const uint THROUGHPUT = 2u;     // state, by the bits below
const uint SHADOW_ORIGIN = 3u;  // end of the shadow ray
const uint SHADOW = 4u;         // seed of masks
const uint SAMPLED = 5u;        // any-hit rays
const uint HIT = 6u;            // four words of the hit
const uint DIRECT_LIGHT = 7u;   // closest-hit rays
const uint INDIRECT_LIGHT = 8u; // distance of the hit
const uint ALBEDO = 9u;         // probability of the way
const uint SOFT_LIGHT = 10u;    // share of the sampled light that is kept apart
const uint KINDS = 11u;

// Bits of the state: the path waits for a shadow ray, and for one to its next surface; it leaves a smooth surface; its shadow ray
// passes clear walls; where the path first met a surface that is not smooth, it chose another light than the key light. Then surfaces that
// are not smooth, up to 2, and all surfaces.
const uint SHADOWED = 1u, ALIVE = 2u, SMOOTH = 4u, PASSING = 8u, PASSED = 16u, SCATTERED_AT = 5u, BOUNCE_AT = 7u;

uint place_of(uint kind, uint i) { return kind * path_count() + i; }

void keep(uint kind, uint i, vec3 v, uint word) { memory[place_of(kind, i)] = uvec4(floatBitsToUint(v), word); }

vec3 kept(uint kind, uint i, out uint word) {
    uvec4 v = memory[place_of(kind, i)];
    word = v.w;
    return uintBitsToFloat(v.xyz);
}

vec3 kept(uint kind, uint i) {
    uint word;
    return kept(kind, i, word);
}

void save_hit(uint i, Hit hit) {
    memory[place_of(HIT, i)] = uvec4(hit.triangle, hit.instance, floatBitsToUint(vec2(hit.b1, hit.b2)));
    memory[place_of(INDIRECT_LIGHT, i)].w = floatBitsToUint(hit.t);
}

void save_path(uint i, PathState p, Departure d) {
    uint state = (d.shadowed ? SHADOWED : 0u) | (d.alive ? ALIVE : 0u) | (p.path.delta ? SMOOTH : 0u) |
                 ((d.shadow.mask_seed & PASSES_WALLS) != 0u ? PASSING : 0u) | (p.passed_over ? PASSED : 0u) |
                 min(p.scattered, 2u) << SCATTERED_AT | p.bounce << BOUNCE_AT;
    keep(ORIGIN, i, p.path.origin, floatBitsToUint(p.path.bsdf_pdf));
    keep(DIRECTION, i, p.path.direction, floatBitsToUint(p.path.eta_scale));
    keep(THROUGHPUT, i, p.path.throughput, state);
    keep(SHADOW_ORIGIN, i, d.shadow.origin, floatBitsToUint(d.shadow.t_max));
    keep(SHADOW, i, d.shadow.direction, p.seed);
    keep(SAMPLED, i, d.sampled, p.any_rays);
    keep(DIRECT_LIGHT, i, p.light.direct, p.closest_rays);
    keep(INDIRECT_LIGHT, i, p.light.indirect, 0u);
    save_hit(i, p.hit);
    if (FX_SPLIT) keep(ALBEDO, i, p.albedo, floatBitsToUint(p.share));
    if (FX_SOFT) keep(SOFT_LIGHT, i, p.light.soft, floatBitsToUint(d.kept));
}

// All of the path but `sharp_only`. Of its departure it sets what is read once the rays are traced: the sampled light and the flags.
PathState saved_path(uint i, out Departure d) {
    PathState p;
    uint pdf, scale, state, t, kept_share = 0u;
    p.path.origin = kept(ORIGIN, i, pdf);
    p.path.direction = kept(DIRECTION, i, scale);
    p.path.throughput = kept(THROUGHPUT, i, state);
    p.path.bsdf_pdf = uintBitsToFloat(pdf);
    p.path.eta_scale = uintBitsToFloat(scale);
    p.path.delta = (state & SMOOTH) != 0u;
    p.scattered = state >> SCATTERED_AT & 3u;
    p.bounce = state >> BOUNCE_AT;
    p.light.direct = kept(DIRECT_LIGHT, i, p.closest_rays);
    p.light.indirect = kept(INDIRECT_LIGHT, i, t);
    p.light.soft = FX_SOFT ? kept(SOFT_LIGHT, i, kept_share) : vec3(0.0);
    p.passed_over = (state & PASSED) != 0u;
    uint share = floatBitsToUint(1.0);
    p.albedo = FX_SPLIT ? kept(ALBEDO, i, share) : vec3(0.0);
    p.share = uintBitsToFloat(share);
    uvec4 hit = memory[place_of(HIT, i)];
    p.hit = Hit(uintBitsToFloat(t), hit.x, hit.y, uintBitsToFloat(hit.z), uintBitsToFloat(hit.w));
    p.seed = memory[place_of(SHADOW, i)].w;
    d.sampled = kept(SAMPLED, i, p.any_rays);
    d.shadowed = (state & SHADOWED) != 0u;
    d.alive = (state & ALIVE) != 0u;
    d.kept = uintBitsToFloat(kept_share);
    return p;
}

// Whether a path waits for a shadow ray, and for one to its next surface.
bvec2 waits_for(uint i) {
    uint state = memory[place_of(THROUGHPUT, i)].w;
    return bvec2((state & SHADOWED) != 0u, (state & ALIVE) != 0u);
}

// The shadow ray of a path, or the one to its next surface.
Segment saved_ray(uint i, bool shadow) {
    uint end, seed = memory[place_of(SHADOW, i)].w, state = memory[place_of(THROUGHPUT, i)].w, bounce = state >> BOUNCE_AT;
    vec3 origin = kept(shadow ? SHADOW_ORIGIN : ORIGIN, i, end), direction = kept(shadow ? SHADOW : DIRECTION, i);
    uint passes = (state & PASSING) != 0u ? PASSES_WALLS : 0u;
    if (shadow) return Segment(origin, direction, uintBitsToFloat(end), shadow_mask_seed(seed, bounce - 1u) | passes);
    return Segment(origin, direction, INFINITE_DISTANCE, path_mask_seed(seed, bounce));
}

// The triangle that a path leaves, and its instance.
uvec2 saved_from(uint i) { return memory[place_of(HIT, i)].xy; }

// Light that something blocks is not added.
void block_light(uint i) { memory[place_of(THROUGHPUT, i)].w &= ~SHADOWED; }

// Of light that passes walls, what they leave.
void dim_light(uint i) {
    uint rays;
    vec3 sampled = kept(SAMPLED, i, rays);
    if (FX_CLEAR_WALLS && wall_depth != uvec3(0u)) keep(SAMPLED, i, behind_walls(sampled), rays);
}
