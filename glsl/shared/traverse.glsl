// Closest hit and any hit through eight-way compressed nodes (Ylitie, Karras, Laine, HPG 2017), as obvhs builds them,
// and a triangle test whose edges are watertight. The including kernel binds `nodes`, `triangles`, `instances`,
// and for masks `shading`, `materials`, `textures`, `texels`.

struct Hit {
    float t;          // world units along the unit ray
    uint triangle;    // leaf order; NONE on a miss
    uint instance;    // NONE without instances
    vec2 barycentric; // weights of vertices 1 and 2
};

// Distances to planes round at 2^-24 in four steps each, near and far; boxes that share a face must not part (Ize 2013).
const float SLAB_ROUNDING = 1.0 + 8.0 / 16777216.0;

// Watertight: all triangles project a shared vertex to the same point of the plane across the ray, and the two
// edge functions of a shared edge are exact negatives of each other (precise forbids fused multiply-adds).
// The idea is that of Woop, Benthin, Wald, JCGT 2013; a rotation replaces their permutation and shear.
struct RaySpace {
    vec3 origin;
    vec3 direction;
    vec3 across_x;
    vec3 across_y;
    vec3 inverse;
    uint octant; // in every byte, 7 minus the octant that the ray points to
};

RaySpace ray_space(vec3 origin, vec3 direction) {
    RaySpace r;
    r.origin = origin;
    r.direction = direction;
    // Duff et al., JCGT 2017. Rays in the space of an instance are not of unit length.
    float len = length(direction);
    vec3 d = direction / len;
    float s = d.z >= 0.0 ? 1.0 : -1.0;
    float a = -1.0 / (s + d.z);
    float b = d.x * d.y * a;
    r.across_x = vec3(1.0 + s * d.x * d.x * a, s * b, -s * d.x);
    r.across_y = vec3(b, s + d.y * d.y * a, -d.y);
    // A zero component must not make 0 * inf in the slab test, for boxes of up to 1e18.
    vec3 safe = mix(direction, vec3(1e-20), lessThan(abs(direction), vec3(1e-20)));
    r.inverse = 1.0 / safe;
    uvec3 positive = uvec3(greaterThanEqual(safe, vec3(0.0)));
    r.octant = (positive.x * 4u + positive.y * 2u + positive.z) * 0x01010101u;
    return r;
}

bool intersect_triangle(RaySpace r, uint index, float t_max, out float t, out vec2 barycentric) {
    vec3 a = triangle_vertex(index, 0) - r.origin;
    vec3 b = triangle_vertex(index, 1) - r.origin;
    vec3 c = triangle_vertex(index, 2) - r.origin;
    precise float ax = dot(r.across_x, a), ay = dot(r.across_y, a);
    precise float bx = dot(r.across_x, b), by = dot(r.across_y, b);
    precise float cx = dot(r.across_x, c), cy = dot(r.across_y, c);
    precise float u = cx * by - cy * bx;
    precise float v = ax * cy - ay * cx;
    precise float w = bx * ay - by * ax;
    float det = u + v + w;
    bool inside = min(min(u, v), w) >= 0.0 || max(max(u, v), w) <= 0.0;
    float inv = 1.0 / det;
    // Distances along the ray in units of its direction's length.
    float scale = 1.0 / dot(r.direction, r.direction);
    t = (u * dot(r.direction, a) + v * dot(r.direction, b) + w * dot(r.direction, c)) * inv * scale;
    barycentric = vec2(v, w) * inv;
    return inside && det != 0.0 && t > 0.0 && t < t_max;
}

// Tests four children; the result has one bit per inner child (24..31, in order of visit) and one per triangle (0..23).
uint intersect_children(uint meta, uint octant, uvec3 near_q, uvec3 far_q, vec3 scale, vec3 origin, float t_max) {
    uint inner = ((meta & (meta << 1)) & 0x10101010u) >> 4;
    uint bit_index = (meta ^ (octant & (inner * 0xffu))) & 0x1f1f1f1fu;
    uint child_bits = (meta >> 5) & 0x07070707u;
    uint mask = 0u;
    for (int i = 0; i < 32; i += 8) {
        vec3 t_near = vec3((near_q >> i) & 0xffu) * scale + origin;
        vec3 t_far = vec3((far_q >> i) & 0xffu) * scale + origin;
        float enter = max(max(t_near.x, t_near.y), max(t_near.z, 0.0));
        float leave = min(min(t_far.x, t_far.y), min(t_far.z, t_max));
        mask |= enter <= leave * SLAB_ROUNDING ? ((child_bits >> i) & 0xffu) << ((bit_index >> i) & 0xffu) : 0u;
    }
    return mask;
}

// Returns the hit mask; `children` = (first inner child, first primitive, inner mask).
uint intersect_node(RaySpace r, uint index, float t_max, out uvec3 children) {
    int at = int(5u * index);
    uvec4 n0 = texelFetch(nodes, at);
    uvec4 n1 = texelFetch(nodes, at + 1);
    uvec4 x = texelFetch(nodes, at + 2); // min 0-3, min 4-7, max 0-3, max 4-7
    uvec4 y = texelFetch(nodes, at + 3);
    uvec4 z = texelFetch(nodes, at + 4);
    children = uvec3(n1.xy, n0.w >> 24);
    vec3 cell = uintBitsToFloat(uvec3(n0.w & 0xffu, (n0.w >> 8) & 0xffu, (n0.w >> 16) & 0xffu) << 23);
    vec3 scale = cell * r.inverse;
    vec3 origin = (uintBitsToFloat(n0.xyz) - r.origin) * r.inverse;
    x = r.inverse.x < 0.0 ? x.zwxy : x;
    y = r.inverse.y < 0.0 ? y.zwxy : y;
    z = r.inverse.z < 0.0 ? z.zwxy : z;
    return intersect_children(n1.z, r.octant, uvec3(x.x, y.x, z.x), uvec3(x.z, y.z, z.z), scale, origin, t_max) |
           intersect_children(n1.w, r.octant, uvec3(x.y, y.y, z.y), uvec3(x.w, y.w, z.w), scale, origin, t_max);
}

// Traverses from `root` (with ROOT_OF_INSTANCES, a level of instances). With `any_hit`, stops at the first triangle;
// otherwise returns the closest. `mask_seed` decides hits on partly transparent surfaces.
Hit traverse(vec3 origin, vec3 direction, float t_max, bool any_hit, uint root, uint mask_seed) {
    Hit hit = Hit(t_max, NONE, NONE, vec2(0.0));
    RaySpace ray = ray_space(origin, direction);
    uvec2 stack[TRAVERSAL_STACK];
    uint depth = 0u;
    uint bottom = 0u;       // stack depth at which the current instance was entered
    uint instance = NONE;   // NONE in the top (or only) level
    bool two_levels = FX_INSTANCES && (root & ROOT_OF_INSTANCES) != 0u;
    // Inner children: base, hit bits and inner mask; or triangles: base, bits.
    uvec2 group = uvec2(root & ~ROOT_OF_INSTANCES, 0x80000000u);
    while (true) {
        uvec2 leaves = uvec2(0u);
        if (group.y > 0x00ffffffu) {
            uint bit = uint(findMSB(group.y));
            uint hits = group.y;
            group.y &= ~(1u << bit);
            if (group.y > 0x00ffffffu) stack[depth++] = group;
            uint slot = (bit - 24u) ^ (ray.octant & 0xffu);
            uint child = group.x + uint(bitCount(hits & ~(0xffffffffu << slot)));
            uvec3 children;
            uint mask = intersect_node(ray, child, hit.t, children);
            if (FX_COUNTERS) nodes_visited++;
            group = uvec2(children.x, (mask & 0xff000000u) | children.z);
            leaves = uvec2(children.y, mask & 0x00ffffffu);
        } else if (two_levels) { // instances that an earlier node left on the stack
            leaves = group;
            group = uvec2(0u);
        }
        if (two_levels && instance == NONE && leaves.y != 0u) {
            uint bit = uint(findMSB(leaves.y));
            leaves.y &= ~(1u << bit);
            if (group.y > 0x00ffffffu) stack[depth++] = group;
            if (leaves.y != 0u) stack[depth++] = leaves;
            instance = leaves.x + bit;
            bottom = depth;
            mat4x3 object_from_world = instance_matrix(instance, 3);
            ray = ray_space(object_from_world * vec4(origin, 1.0), mat3(object_from_world) * direction);
            group = uvec2(instance_root(instance), 0x80000000u);
            continue;
        }
        while (leaves.y != 0u) {
            uint bit = uint(findMSB(leaves.y));
            leaves.y &= ~(1u << bit);
            float t;
            vec2 barycentric;
            uint index = leaves.x + bit;
            if (intersect_triangle(ray, index, hit.t, t, barycentric)) {
                if (FX_ALPHA_MASKS && !mask_blocks(index, instance, barycentric, mask_seed)) continue;
                hit = Hit(t, index, instance, barycentric);
                if (any_hit) return hit;
            }
        }
        if (group.y <= 0x00ffffffu) {
            if (FX_INSTANCES && instance != NONE && depth == bottom) {
                instance = NONE;
                bottom = 0u;
                ray = ray_space(origin, direction);
            }
            if (depth == 0u) break;
            group = stack[--depth];
        }
    }
    return hit;
}
