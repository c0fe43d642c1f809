// Traversal by whole subgroups. The rays of a subgroup differ in how many triangles they meet at a node, most in none, so that
// lanes which test their own wait for each other. Here the triangles are dealt to all lanes, which test them for each other:
// on lavapipe in a third of the turns. Every function must be called by all lanes, and returns the same bits as each ray alone.
#include "shared/traverse.glsl"

// Whether some of what rays meet is looked at apart.
const bool APART = FX_ALPHA_MASKS || FX_SPHERES;

#ifdef RAY_QUERY
const bool DEALT = false;
bool any_lane(bool says) { return says; }
// `DEALT` rules out both calls: there are no lanes to deal to.
Hit deal_shadow_then_closest(Segment shadow, inout bool shadowed, Segment ray, bool alive, uint root, uvec2 from) {
    return Hit(0.0, NONE, NONE, 0.0, 0.0);
}
Hit deal_closest(Segment ray, bool on, uint root) { return Hit(0.0, NONE, NONE, 0.0, 0.0); }
#else
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_shuffle : require
layout(constant_id = 105) const uint LANES = 0u; // lanes of a subgroup, a power of two from 4 to 32; 0: each ray tests its own
uint this_lane() { return gl_SubgroupInvocationID; }
uint from_lane(uint x, uint lane) { return subgroupShuffle(x, lane); }

const bool DEALT = FX_DEALT && LANES > 0u;
const uint LAST_LANE = LANES - 1u;

float from_lane(float x, uint lane) { return uintBitsToFloat(from_lane(floatBitsToUint(x), lane)); }
vec3 from_lane(vec3 v, uint lane) { return vec3(from_lane(v.x, lane), from_lane(v.y, lane), from_lane(v.z, lane)); }

// The steps of reductions are written out here and below, since lavapipe does not unroll their loops.

// Whether any lane says so; of a ray alone, whether it does.
bool any_lane(bool says) {
    if (!DEALT) return says;
    uint lane = this_lane(), x = uint(says);
    x |= from_lane(x, lane ^ 1u);
    x |= from_lane(x, lane ^ 2u);
    if (LANES > 4u) x |= from_lane(x, lane ^ 4u);
    if (LANES > 8u) x |= from_lane(x, lane ^ 8u);
    if (LANES > 16u) x |= from_lane(x, lane ^ 16u);
    return x != 0u;
}

uint add_below(uint sum, uint by) {
    uint lane = this_lane(), below = from_lane(sum, lane - by);
    return sum + (lane >= by ? below : 0u);
}

// The sum over this lane and all before it.
uint inclusive_sum(uint sum) {
    sum = add_below(sum, 1u);
    sum = add_below(sum, 2u);
    if (LANES > 4u) sum = add_below(sum, 4u);
    if (LANES > 8u) sum = add_below(sum, 8u);
    if (LANES > 16u) sum = add_below(sum, 16u);
    return sum;
}

// The lane that holds item number `k`, where `ends` are the inclusive sums of how many each lane holds.
uint lane_of(uint ends, uint k) {
    uint lane = 0u;
    if (LANES > 16u) lane += from_lane(ends, 15u) <= k ? 16u : 0u;
    if (LANES > 8u) lane += from_lane(ends, lane + 7u) <= k ? 8u : 0u;
    if (LANES > 4u) lane += from_lane(ends, lane + 3u) <= k ? 4u : 0u;
    lane += from_lane(ends, lane + 1u) <= k ? 2u : 0u;
    return lane + (from_lane(ends, lane) <= k ? 1u : 0u);
}

// Index of the bit of rank `r`, counted from the lowest of 24 bits that is set.
uint select_bit(uint bits, uint r) {
    uint n = uint(bitCount(bits & 0xfffu)), at = r >= n ? 12u : 0u;
    r -= r >= n ? n : 0u;
    bits >>= at;
    n = uint(bitCount(bits & 0x3fu));
    bits = r >= n ? bits >> 6 : bits;
    at += r >= n ? 6u : 0u;
    r -= r >= n ? n : 0u;
    n = uint(bitCount(bits & 0x7u));
    bits = r >= n ? bits >> 3 : bits;
    at += r >= n ? 3u : 0u;
    r -= r >= n ? n : 0u;
    bits = r >= 1u ? bits & (bits - 1u) : bits;
    bits = r >= 2u ? bits & (bits - 1u) : bits;
    return at + ((bits & 1u) != 0u ? 0u : (bits & 2u) != 0u ? 1u : 2u);
}

// Keeps the nearer of two hits: this lane's, and that of the lane `by` further on where it is for the same ray.
void take_nearer(uint by, uint ray_lane, inout uint distance, inout uint winner) {
    uint at = min(this_lane() + by, LAST_LANE);
    uint other = from_lane(distance, at), its = from_lane(winner, at);
    bool nearer = from_lane(ray_lane, at) == ray_lane && other < distance;
    distance = nearer ? other : distance;
    winner = nearer ? its : winner;
}

// All bits of this lane and of the lane `by` further on, where that is for the same ray.
uint joined(uint by, uint ray_lane, uint bits) {
    uint at = min(this_lane() + by, LAST_LANE), its = from_lane(bits, at);
    return from_lane(ray_lane, at) == ray_lane ? bits | its : bits;
}

bool is_masked(uint triangle, uint instance) {
    const uint MASKS = MATERIAL_MASKED | (FX_CLEAR_WALLS ? MATERIAL_CLEAR_WALL : 0u);
    return FX_ALPHA_MASKS && (Material_flags(materials, material_of(triangle, instance)) & MASKS) != 0u;
}

// Tests the triangles of all lanes' `leaves`. Returns whether the nearest that this lane's ray meets before `hit`, which it
// becomes, has a mask; `spheres` are the bits of this lane's that are none. Bits go from the highest down, so that of two triangles
// at one distance the same counts as for a ray alone.
bool deal_triangles(inout Hit hit, Leaves leaves, uvec2 from, out uint spheres) {
    uint lane = this_lane();
    uint n = uint(bitCount(leaves.bits)), ends = inclusive_sum(n), begin = ends - n;
    uint total = from_lane(ends, LAST_LANE), first = 0u;
    uint axis = uint(leaves.ray.along_x) | uint(leaves.ray.along_y) << 1;
    bool masked = false;
    spheres = 0u;
    do {
        uint k = first + lane, owner = lane_of(ends, k);
        bool dealt = k < total;
        uint rank = from_lane(ends, owner) - 1u - k;
        // Lanes are read where all are at one place of the code: what others read of a lane that is not there is undefined.
        uint its_bits = from_lane(leaves.bits, owner), its_first = from_lane(leaves.first, owner);
        uvec2 its_from = uvec2(from_lane(from.x, owner), FX_INSTANCES ? from_lane(from.y, owner) : NONE);
        uint bit = dealt ? select_bit(its_bits, rank) : 0u;
        uint index = dealt ? its_first + bit : 0u;
        bool sphere = FX_SPHERES && dealt && is_sphere(index);
        RaySpace ray;
        ray.origin = from_lane(leaves.ray.origin, owner);
        ray.shear = from_lane(leaves.ray.shear, owner);
        uint its_axis = from_lane(axis, owner);
        ray.along_x = (its_axis & 1u) != 0u;
        ray.along_y = (its_axis & 2u) != 0u;
        uint instance = FX_INSTANCES ? from_lane(leaves.instance, owner) : NONE;
        float t;
        vec2 barycentric;
        bool meets = intersect_triangle(ray, index, from_lane(hit.t, owner), t, barycentric) && dealt && !sphere &&
                     (index != its_from.x || (FX_INSTANCES && instance != its_from.y));
        uint distance = meets ? floatBitsToUint(t) : 0xffffffffu, winner = lane;
        take_nearer(1u, owner, distance, winner);
        take_nearer(2u, owner, distance, winner);
        if (LANES > 4u) take_nearer(4u, owner, distance, winner);
        if (LANES > 8u) take_nearer(8u, owner, distance, winner);
        if (LANES > 16u) take_nearer(16u, owner, distance, winner);
        // The first lane that tested for this ray has its nearest hit.
        uint at = min(max(begin, first) - first, LAST_LANE);
        bool tested = n > 0u && ends > first && begin < first + LANES;
        uint nearest = from_lane(distance, at), by = from_lane(winner, at);
        bool better = tested && nearest < floatBitsToUint(hit.t);
        uint triangle = from_lane(index, by);
        float b1 = from_lane(barycentric.x, by), b2 = from_lane(barycentric.y, by);
        hit.t = better ? uintBitsToFloat(nearest) : hit.t;
        hit.triangle = better ? triangle : hit.triangle;
        if (FX_INSTANCES) hit.instance = better ? leaves.instance : hit.instance;
        hit.b1 = better ? b1 : hit.b1;
        hit.b2 = better ? b2 : hit.b2;
        if (FX_SPHERES) {
            uint found = joined(1u, owner, sphere ? 1u << bit : 0u);
            found = joined(2u, owner, found);
            if (LANES > 4u) found = joined(4u, owner, found);
            if (LANES > 8u) found = joined(8u, owner, found);
            if (LANES > 16u) found = joined(16u, owner, found);
            found = from_lane(found, at);
            spheres |= tested ? found : 0u;
        }
        if (FX_ALPHA_MASKS) {
            bool its_mask = from_lane(uint(is_masked(index, instance)), by) != 0u;
            masked = better ? its_mask : masked;
        }
        first += LANES;
    } while (first < total);
    return masked;
}

// A ray on its way, of a subgroup.
struct Walk {
    Traversal t;
    RaySpace world;
    bool on;       // whether there is a ray
    bool any_hit;
    uint mask_seed;
    Leaves leaves; // of the last node
    bool last;     // no node is left
    bool again;    // a mask let the ray pass a triangle of `leaves`, the others are tested again
    Hit next;      // the nearest of `leaves`
    bool masked;   // `next` counts only if its mask says so
    uint spheres;  // bits of `leaves` that are spheres still to be tested
};

Walk walk_start(Segment ray, RaySpace world, bool on, bool any_hit, uint root) {
    Traversal t = traversal_start(ray.t_max, root);
    return Walk(t, world, on, any_hit, ray.mask_seed, Leaves(world, 0u, 0u, NONE), false, false, t.hit, false, 0u);
}

// Whether the ray has met what is looked at apart.
bool is_apart(Walk w) { return (FX_ALPHA_MASKS && w.masked) || (FX_SPHERES && w.spheres != 0u); }

bool has_ended(Walk w) { return !is_apart(w) && ((w.last && !w.again) || (w.any_hit && w.t.hit.triangle != NONE)); }

// Looks up the mask of the nearest triangle.
void decide_mask(inout Walk w) {
    vec2 barycentric = vec2(w.next.b1, w.next.b2);
    bool blocks = mask_blocks(w.next.triangle, w.leaves.instance, barycentric, w.leaves.ray.direction, w.mask_seed);
    if (blocks) w.t.hit = w.next;
    else w.leaves.bits &= ~(1u << (w.next.triangle - w.leaves.first));
    w.again = !blocks && w.leaves.bits != 0u;
    w.masked = false;
}

// Tests the spheres of `leaves`, with their masks.
void meet_spheres(inout Walk w, uvec2 from) {
    do {
        uint index = w.leaves.first + take_highest(w.spheres);
        intersect_masked(w.t.hit, w.leaves.ray, index, w.leaves.instance, w.mask_seed, from, true);
        if (w.any_hit && w.t.hit.triangle != NONE) w.spheres = 0u;
    } while (w.spheres != 0u);
}

// Looks at what a ray has met apart. Lanes whose rays have met nothing such keep the others company.
void look_apart(inout Walk w, uvec2 from) {
    w.leaves.bits &= ~w.spheres; // where a mask lets a ray pass, the others are tested again
    if (FX_ALPHA_MASKS && w.masked) decide_mask(w);
    if (FX_SPHERES && w.spheres != 0u) meet_spheres(w, from);
}

// Goes on until the ray of some lane ends or meets what is looked at apart. Some lane must have a ray.
void walk_on(inout Walk w, uint root, uvec2 from) {
    do {
        do {
            uvec2 met = uvec2(0u);
            do {
                if (!w.again) w.last = visit_node(w.t, w.world, w.on, root, w.leaves, met) && w.on;
            } while (!any_lane(w.last || w.leaves.bits != 0u || (FX_INSTANCES && met.y != 0u)));
            if (FX_INSTANCES && met.y != 0u) enter_instance(w.t, w.world, met);
        } while (FX_INSTANCES && !any_lane(w.last || w.leaves.bits != 0u));
        w.next = w.t.hit;
        w.masked = deal_triangles(w.next, w.leaves, from, w.spheres);
        if (!w.masked) {
            w.t.hit = w.next;
            w.again = false;
        }
    } while (!any_lane(is_apart(w) || has_ended(w)));
}

// A shadow ray that has ended gives way to the ray behind it.
void follow(inout Walk w, inout bool shadowed, Segment ray, RaySpace space, bool alive, uint root) {
    bool ends = has_ended(w);
    if (ends && w.any_hit) {
        shadowed = w.t.hit.triangle != NONE;
        w = walk_start(ray, space, alive, false, root);
    } else if (ends) {
        w.on = false;
    }
}

// trace_shadow_then_closest where DEALT. lavapipe executes the code of a branch that no lane takes, but leaves a loop: what is rare
// stands behind the loop of what is frequent. A node is visited most often, then triangles are tested, rays end, and last
// masks and spheres are met.
Hit deal_shadow_then_closest(Segment shadow, inout bool shadowed, Segment ray, bool alive, uint root, uvec2 from) {
    RaySpace second = ray_space(ray.origin, ray.direction);
    RaySpace first = select_ray(shadowed, ray_space(shadow.origin, shadow.direction), second);
    if (!shadowed) shadow = ray;
    Walk w = walk_start(shadow, first, shadowed || alive, shadowed, root);
    shadowed = false;
    if (FX_CLEAR_WALLS) wall_depth = uvec3(0u);
    if (any_lane(w.on)) do {
        do {
            walk_on(w, root, from);
            follow(w, shadowed, ray, second, alive, root);
        } while (any_lane(w.on) && !(APART && any_lane(is_apart(w))));
        if (APART) {
            look_apart(w, from);
            follow(w, shadowed, ray, second, alive, root);
        }
    } while (any_lane(w.on));
    ended_early = ended_early || w.on;
    return w.t.hit;
}

// traverse where DEALT, of a ray that is `on`.
Hit deal_closest(Segment ray, bool on, uint root) {
    bool shadowed = false;
    return deal_shadow_then_closest(ray, shadowed, ray, on, root, uvec2(NONE));
}
#endif
