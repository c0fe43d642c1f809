// Closest hit and any hit of a ray through eight-way compressed nodes (Ylitie, Karras, Laine, HPG 2017), as
// scene/build/bvh builds them, with a watertight triangle test. Kernels call what trace.glsl makes of it.
//
// The code is shaped for lavapipe, which executes all of it under masks for every node: few instructions and few variables that
// live from step to step count for more than early exits. A loop that tests at its head would run its body once more with no
// lane active, so loops test at their end. A GPU would gain from early exits, and loses a little by both.

#include "shared/scene.glsl"
#include "shared/texture.glsl"

uint nodes_visited = 0u; // by this thread
// Whether a search of this thread was left before its end, as llvmpipe does after many turns: see shared/loop_limit.glsl. The state
// tells it, not the loop's condition, which compilers take for known behind the loop.
bool ended_early = false;

// Number of groups that a ray of this scene can leave on its stack (scene/build/bvh.rs). Two stay in registers. lavapipe writes
// to an array lane by lane, with a branch each, so that an unconditional write, useless where no group is left, costs less.
layout(constant_id = 102) const uint STACK = TRAVERSAL_STACK;
const bool SHALLOW = STACK <= 2u;
uvec2 stack[STACK + 1u];

void push_group(inout uint depth, uvec2 group, bool left) {
    if (SHALLOW) {
        stack[1] = left ? stack[0] : stack[1];
        stack[0] = left ? group : stack[0];
    } else {
        stack[depth] = group;
    }
    // Valid scenes need no more than STACK; the limit keeps invalid ones within the array.
    depth = SHALLOW ? depth + uint(left) : min(depth + uint(left), STACK);
}

uvec2 pop_group(inout uint depth) {
    depth--;
    uvec2 group = stack[SHALLOW ? 0u : depth];
    if (SHALLOW) stack[0] = stack[1];
    return group;
}

// A ray prepared for the watertight test (Woop, Benthin, Wald, JCGT 2013): all triangles project a shared vertex to the same point
// of the plane across the ray, and the two edge functions of a shared edge are exact negatives of each other (precise forbids
// fused multiply-adds). Departure: two axes are swapped where the paper permutes three, which mirrors triangles; both windings
// hit.
struct RaySpace {
    vec3 origin;
    vec3 direction; // as given; instances and spheres need it
    vec3 inverse;   // 1 / direction
    vec3 shear;     // maps the direction to (0, 0, 1) once its largest component is the last
    bool along_x;   // the largest component is x
    bool along_y;
    uint octant;    // in every byte, 7 minus the octant that the ray points to
};

vec3 largest_last(bool along_x, bool along_y, vec3 v) {
    return vec3(along_x ? v.z : v.x, along_y ? v.z : v.y, along_x ? v.x : along_y ? v.y : v.z);
}

RaySpace ray_space(vec3 origin, vec3 direction) {
    RaySpace r;
    r.origin = origin;
    r.direction = direction;
    // A zero component must not make 0 * inf in the slab test, for boxes of up to 1e18.
    vec3 safe = mix(direction, vec3(1e-20), lessThan(abs(direction), vec3(1e-20)));
    r.inverse = 1.0 / safe;
    vec3 size = abs(direction);
    r.along_x = size.x > max(size.y, size.z);
    r.along_y = !r.along_x && size.y > size.z;
    r.shear.z = largest_last(r.along_x, r.along_y, r.inverse).z;
    r.shear.xy = largest_last(r.along_x, r.along_y, direction).xy * r.shear.z;
    uvec3 positive = uvec3(greaterThanEqual(safe, vec3(0.0)));
    r.octant = (positive.x * 4u + positive.y * 2u + positive.z) * 0x01010101u;
    return r;
}

RaySpace select_ray(bool first, RaySpace a, RaySpace b) {
    bvec3 all = bvec3(first);
    return RaySpace(mix(b.origin, a.origin, all), mix(b.direction, a.direction, all), mix(b.inverse, a.inverse, all),
                    mix(b.shear, a.shear, all), first ? a.along_x : b.along_x, first ? a.along_y : b.along_y,
                    first ? a.octant : b.octant);
}

bool intersect_triangle(RaySpace r, uint index, float t_max, out float t, out vec2 barycentric) {
    vec3 a = largest_last(r.along_x, r.along_y, Triangle_v0(triangles, index) - r.origin);
    vec3 b = largest_last(r.along_x, r.along_y, Triangle_v1(triangles, index) - r.origin);
    vec3 c = largest_last(r.along_x, r.along_y, Triangle_v2(triangles, index) - r.origin);
    precise vec2 p = a.xy - r.shear.xy * a.z, q = b.xy - r.shear.xy * b.z, s = c.xy - r.shear.xy * c.z;
    precise float u = s.x * q.y - s.y * q.x;
    precise float v = p.x * s.y - p.y * s.x;
    precise float w = q.x * p.y - q.y * p.x;
    float det = u + v + w;
    // Comparisons are cheaper than minima and maxima, which have to test for NaN.
    bool inside = (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
    // Coordinates of up to 1e12 shear to 4e12; areas are up to 6.4e25, and the products below are finite (MAX_COORDINATE).
    float inv = 1.0 / det;
    t = (u * a.z + v * b.z + w * c.z) * (inv * r.shear.z);
    barycentric = vec2(v, w) * inv;
    return inside && det != 0.0 && t > 0.0 && t < t_max;
}

// Intersects a sphere (after Haines, Guenther, Akenine-Moeller 2019, Ray Tracing Gems, chapter 7). It finds the ray's point
// nearest to the centre in two steps, since the first one's rounding matters for far or small spheres; both hits lie half the
// chord from there. With `far`, a ray that leaves the sphere or was let in meets only its far side; it becomes whether that is met.
bool intersect_sphere(RaySpace r, uint index, float t_max, inout bool far, out float t, out vec2 normal) {
    vec3 pole = Triangle_v1(triangles, index), from_centre = r.origin - Triangle_v0(triangles, index);
    float inverse = inversesqrt(dot(r.direction, r.direction));
    vec3 d = r.direction * inverse;
    float along = dot(from_centre, d);
    vec3 nearest = from_centre - along * d;
    float rest = dot(nearest, d);
    nearest -= rest * d;
    along += rest;
    float squared = dot(pole, pole) - dot(nearest, nearest);
    float chord = sqrt(max(squared, 0.0)); // half its length
    far = far || !(-along - chord > 0.0);
    normal = octahedral_point(nearest + (far ? chord : -chord) * d);
    t = ((far ? chord : -chord) - along) * inverse;
    return squared >= 0.0 && t > 0.0 && t < t_max;
}

// Near and far distances round at 2^-24 in four steps each; boxes that share a face must not leave a gap (Ize 2013).
const int SLAB_ROUNDING = 8; // units in the last place

// Tests four children. The result has one bit for each inner child hit (24..31, in order of visit) and for each of the leaf
// children's triangles (0..23). Distances are compared as integers, which order floats correctly as long as one of the two is
// not negative.
uint intersect_children(uint meta, uint octant, uvec3 near_q, uvec3 far_q, vec3 scale, vec3 origin, int t_max) {
    uint inner = ((meta & (meta << 1)) & 0x10101010u) >> 4;
    uint bit_index = (meta ^ (octant & (inner * 0xffu))) & 0x1f1f1f1fu;
    uint child_bits = (meta >> 5) & 0x07070707u;
    uint mask = 0u;
    for (int i = 0; i < 32; i += 8) {
        ivec3 t_near = floatBitsToInt(vec3((near_q >> i) & 0xffu) * scale + origin);
        ivec3 t_far = floatBitsToInt(vec3((far_q >> i) & 0xffu) * scale + origin);
        int enter = max(max(t_near.x, t_near.y), max(t_near.z, 0));
        int leave = min(min(t_far.x, t_far.y), min(t_far.z, t_max));
        mask |= enter <= leave + SLAB_ROUNDING ? ((child_bits >> i) & 0xffu) << ((bit_index >> i) & 0xffu) : 0u;
    }
    return mask;
}

// Tests all eight children. Returns the hit mask; `children` = (first inner child, first primitive, mask of inner children).
uint intersect_node(RaySpace r, uint index, float t_max, out uvec3 children) {
    BvhNode node = BvhNode_load(nodes, index);
    uint exponents = node.e_imask;
    children = uvec3(node.child_base, node.primitive_base, exponents >> 24);
    vec3 cell = uintBitsToFloat(uvec3(exponents & 0xffu, (exponents >> 8) & 0xffu, (exponents >> 16) & 0xffu) << 23);
    vec3 scale = cell * r.inverse;
    vec3 origin = (node.p - r.origin) * r.inverse;
    // Near planes of children 0-3 and 4-7, then far ones.
    uvec4 x = uvec4(node.min_x, node.max_x), y = uvec4(node.min_y, node.max_y), z = uvec4(node.min_z, node.max_z);
    x = r.inverse.x < 0.0 ? x.zwxy : x;
    y = r.inverse.y < 0.0 ? y.zwxy : y;
    z = r.inverse.z < 0.0 ? z.zwxy : z;
    int t = floatBitsToInt(t_max);
    return intersect_children(node.meta.x, r.octant, uvec3(x.x, y.x, z.x), uvec3(x.z, y.z, z.z), scale, origin, t) |
           intersect_children(node.meta.y, r.octant, uvec3(x.y, y.y, z.y), uvec3(x.w, y.w, z.w), scale, origin, t);
}

layout(constant_id = 106) const bool NATIVE_BITS = false; // instructions that find and count bits

// Removes the highest of `bits`, which are below 2^24, and returns its index; 0 for no bits, see `intersect_triangles`. It reads a
// float's exponent, since findMSB is a long sequence on lavapipe.
uint take_highest(inout uint bits) {
    uint highest;
    if (NATIVE_BITS) {
        highest = uint(max(findMSB(bits), 0));
        bits &= ~(1u << highest);
    } else {
        uint f = floatBitsToUint(float(int(bits)));
        bits ^= uint(int(uintBitsToFloat(f & 0xff800000u)));
        highest = max(f >> 23, 127u) - 127u;
    }
    return highest;
}

// Number of bits set in a byte: the first product copies each to a nibble of its own, the second sums the nibbles. It replaces
// bitCount for lavapipe.
uint count_bits(uint byte) {
    uint count;
    if (NATIVE_BITS) count = uint(bitCount(byte));
    else count = ((((byte * 0x08040201u) >> 3) & 0x11111111u) * 0x11111111u) >> 28;
    return count;
}

// The state of a ray's traversal between two steps.
struct Traversal {
    Hit hit;         // the closest so far
    uint base;       // current group: index of its first inner child or instance
    uint bits;       // current group: hit bits (24..31) and mask of inner children, or hit bits below 24 of instances
    uint depth;      // groups on the stack
    uint bottom;     // depth at which `instance` was entered
    uint instance;   // NONE in the top (or only) level
    RaySpace inside; // the ray in the space of `instance`
    // With TRIANGLES_A_STEP, those of the last node that are still to test, as in `Leaves`, and whether no node is left.
    uint kept_first, kept_bits, kept_instance;
    bool last;
};

Traversal traversal_start(float t_max, uint root) {
    Traversal t;
    t.hit = Hit(t_max, NONE, NONE, 0.0, 0.0);
    t.base = root & ~ROOT_OF_INSTANCES;
    t.bits = 0x80000000u;
    t.depth = 0u;
    t.bottom = 0u;
    t.instance = NONE;
    t.kept_first = 0u;
    t.kept_bits = 0u;
    t.kept_instance = NONE;
    t.last = false;
    return t;
}

// Whether a search that is to visit every node has yet some to visit.
bool has_nodes_left(Traversal t) { return t.bits > 0x00ffffffu || t.depth > 0u; }

void enter_instance(inout Traversal t, RaySpace world, uvec2 leaves) {
    uint bit = take_highest(leaves.y);
    push_group(t.depth, uvec2(t.base, t.bits), t.bits > 0x00ffffffu);
    push_group(t.depth, leaves, leaves.y != 0u);
    t.instance = leaves.x + bit;
    t.bottom = t.depth;
    mat4x3 object = object_from_world(t.instance);
    t.inside = ray_space(object * vec4(world.origin, 1.0), mat3(object) * world.direction);
    t.base = Instance_root(instances, t.instance);
    t.bits = 0x80000000u;
}

// Triangles to test: bits counted from the triangle `first`, and the ray in the space of their instance.
struct Leaves {
    RaySpace ray;
    uint first;
    uint bits;
    uint instance;
};

// Whether a ray leaves this triangle or sphere: see `traversal_step`.
bool is_left(uint index, uint instance, uvec2 from) { return index == from.x && (!FX_INSTANCES || instance == from.y); }

// Intersects a triangle or sphere. `far` says whether the ray leaves it, and becomes whether it meets the far side of a sphere.
bool intersect_primitive(RaySpace r, uint index, float t_max, inout bool far, out float t, out vec2 barycentric) {
    bool meets = intersect_triangle(r, index, t_max, t, barycentric) && !far;
    if (FX_SPHERES && is_sphere(index)) meets = intersect_sphere(r, index, t_max, far, t, barycentric);
    return meets;
}

// Tests all `leaves`; returns whether one is hit. For lavapipe, which fetches for masked lanes too, a lane without triangles keeps
// the index that it tested last, or the scene's first, so that it misses no cache. An any hit ends the loop one triangle late, so
// that the next fetch waits for no test and tests overlap. Variables that live from turn to turn are scalar, since vectors would
// be copied.
bool intersect_triangles(inout Hit hit, Leaves leaves, bool any_hit, uvec2 from) {
    uint left = leaves.bits, instance = leaves.instance;
    bool found = false;
    if (left != 0u) do {
        uint index = leaves.first + take_highest(left);
        if (found && any_hit) left = 0u;
        float distance;
        vec2 barycentric;
        bool far = is_left(index, instance, from);
        bool meets = intersect_primitive(leaves.ray, index, hit.t, far, distance, barycentric) && !(found && any_hit);
        if (meets) {
            hit.t = distance;
            hit.triangle = index;
            if (FX_INSTANCES) hit.instance = instance;
            hit.b1 = barycentric.x;
            hit.b2 = barycentric.y;
        }
        found = found || meets;
    } while (left != 0u);
    return found;
}

// Tests a triangle or sphere together with its mask, which decides on each side of a sphere separately. With `sphere` it is one.
void intersect_masked(inout Hit hit, RaySpace ray, uint index, uint instance, uint mask_seed, uvec2 from, bool sphere) {
    bool far = is_left(index, instance, from), passes_near;
    do {
        float t;
        vec2 barycentric;
        bool meets;
        if (sphere) meets = intersect_sphere(ray, index, hit.t, far, t, barycentric);
        else meets = intersect_primitive(ray, index, hit.t, far, t, barycentric);
        passes_near = false;
        if (FX_ALPHA_MASKS && meets) {
            bool on_sphere = FX_SPHERES && (sphere || is_sphere(index));
            uint seed = on_sphere && far ? mask_seed ^ MASK_HASH : mask_seed;
            meets = mask_blocks(index, instance, barycentric, ray.direction, seed);
            passes_near = on_sphere && !far && !meets;
            far = true;
        }
        if (meets) hit = Hit(t, index, instance, barycentric.x, barycentric.y);
    } while (passes_near);
}

// Tests the triangles of `leaves`. Only the nearest one's mask is looked up; where the ray passes it, the others are tested again.
// Not where walls count how often they are asked, nor among spheres, which may be met once more.
void intersect_leaves(inout Hit hit, Leaves leaves, bool any_hit, uint mask_seed, uvec2 from) {
    if (!FX_ALPHA_MASKS) {
        intersect_triangles(hit, leaves, any_hit, from);
        return;
    }
    if (FX_CLEAR_WALLS || FX_SPHERES) {
        if (leaves.bits != 0u) do {
            uint index = leaves.first + take_highest(leaves.bits);
            intersect_masked(hit, leaves.ray, index, leaves.instance, mask_seed, from, false);
        } while (leaves.bits != 0u && !(any_hit && hit.triangle != NONE));
        return;
    }
    bool passes;
    if (leaves.bits != 0u) do {
        Hit next = hit;
        bool found = intersect_triangles(next, leaves, any_hit, from);
        passes = found && !mask_blocks(next.triangle, leaves.instance, vec2(next.b1, next.b2), leaves.ray.direction, mask_seed);
        if (passes) leaves.bits &= ~(1u << (next.triangle - leaves.first));
        else hit = next;
    } while (passes && leaves.bits != 0u);
}

// Visits one node below `root` (with ROOT_OF_INSTANCES, a level of instances) of a ray that is `on`. Returns true when no node is
// left. Where `met` is not empty, the ray goes on only by enter_instance.
bool visit_node(inout Traversal t, RaySpace world, bool on, uint root, out Leaves leaves, out uvec2 met) {
    bool two_levels = FX_INSTANCES && (root & ROOT_OF_INSTANCES) != 0u;
    RaySpace ray = world;
    if (FX_INSTANCES) ray = select_ray(t.instance != NONE, t.inside, world);
    uvec2 group = uvec2(t.base, t.bits); // instances that an earlier node left on the stack
    if (!two_levels || t.bits > 0x00ffffffu) {
        uint hits = t.bits >> 24, inner = t.bits & 0xffu;
        uint slot = take_highest(hits) ^ (ray.octant & 0xffu);
        push_group(t.depth, uvec2(t.base, (hits << 24) | inner), on && hits != 0u);
        uvec3 children;
        uint mask = intersect_node(ray, t.base + count_bits(inner & ~(0xffffffffu << slot)), t.hit.t, children);
        if (FX_COUNTERS) nodes_visited += uint(on);
        t.base = children.x;
        t.bits = (mask & 0xff000000u) | children.z;
        group.y = mask & 0x00ffffffu;
        group.x = group.y != 0u ? children.y : 0u;
    } else {
        t.bits = 0u;
    }
    group.y = on ? group.y : 0u;
    met = uvec2(0u);
    if (two_levels && t.instance == NONE) {
        met = group;
        group.y = 0u;
    }
    leaves = Leaves(ray, group.x, group.y, t.instance);
    bool left = t.bits <= 0x00ffffffu && met.y == 0u, last = left && t.depth == 0u;
    if (left && !last) {
        if (FX_INSTANCES && t.depth == t.bottom) {
            t.instance = NONE;
            t.bottom = 0u;
        }
        group = pop_group(t.depth);
        t.base = group.x;
        t.bits = group.y;
    }
    return last;
}

// Most triangles that a ray tests between two nodes, 0 for all of a node's: rays that have many hold up fewer of their neighbours.
// Not in scenes of a few nodes: paths in the Cornell box took an H200 1.17 of the time with 2.
layout(constant_id = 107) const uint TRIANGLES_A_STEP = 0u;
const bool BOUNDED = TRIANGLES_A_STEP > 0u && !SHALLOW;

void keep(inout Traversal t, Leaves leaves, bool last) {
    t.kept_first = leaves.first;
    t.kept_bits = leaves.bits;
    t.kept_instance = leaves.instance;
    t.last = last;
}

// Tests the next TRIANGLES_A_STEP triangles that are kept, each with its mask, in the order of tests of all at once.
void intersect_kept(inout Traversal t, RaySpace world, uint mask_seed, uvec2 from) {
    RaySpace ray = world;
    if (FX_INSTANCES) ray = select_ray(t.kept_instance != NONE, t.inside, world);
    [[unroll]] for (uint i = 0u; i < TRIANGLES_A_STEP; i++) {
        if (t.kept_bits == 0u) break;
        intersect_masked(t.hit, ray, t.kept_first + take_highest(t.kept_bits), t.kept_instance, mask_seed, from, false);
    }
}

// Visits a node and its triangles, or goes on with those of the last. Returns true when nothing is left, or with `any_hit` when a
// triangle is found. `from` is the triangle that the ray leaves, and its instance. That triangle, or the near side of that sphere,
// is not tested, since the offset of the origin can be smaller than the error of the distance.
bool traversal_step(inout Traversal t, RaySpace world, bool any_hit, uint root, uint mask_seed, uvec2 from) {
    Leaves leaves;
    uvec2 met;
    bool last = false;
    if (!BOUNDED || t.kept_bits == 0u) {
        last = visit_node(t, world, true, root, leaves, met);
        if (FX_INSTANCES && met.y != 0u) enter_instance(t, world, met);
        if (BOUNDED) keep(t, leaves, last);
    }
    if (BOUNDED) {
        intersect_kept(t, world, mask_seed, from);
        last = t.last && t.kept_bits == 0u;
    } else {
        intersect_leaves(t.hit, leaves, any_hit, mask_seed, from);
    }
    return last || (any_hit && t.hit.triangle != NONE);
}
