// A ray, and what it meets.
#include "shared/pcg.glsl"

struct Hit {
    float t;          // distance in lengths of the ray's direction
    uint triangle;    // index in leaf order; NONE on a miss
    uint instance;    // NONE without instances
    float b1, b2;     // weights of vertices 1 and 2; of a sphere, see sphere.glsl
};

// Seeds of masks hold the index of the sample, its bits reversed, and below it a hash of all else. Without BY_CHANCE, half and less of
// opacity lets every ray pass: STRONGER_WAY. PASSES_WALLS is set for shadow rays of lights without extent, which pass clear walls.
const uint STRONGER_WAY = 0u, MASK_INDEX = 0xffff0000u, MASK_HASH = 0xfffcu, BY_CHANCE = 2u, PASSES_WALLS = 1u;

uint mask_bits(uint word) { return word & ~PASSES_WALLS; }

// What decides about masks on a path's way to its surface number `bounce`, and on that from there to a light.
uint mask_seed(uint seed, uint way) {
    return (seed & (MASK_INDEX | BY_CHANCE)) | (pcg((seed & MASK_HASH) ^ (way << 16)) & MASK_HASH);
}
uint path_mask_seed(uint seed, uint bounce) { return mask_seed(seed, 2u * bounce); }
uint shadow_mask_seed(uint seed, uint bounce) { return mask_seed(seed, 2u * bounce + 1u); }

// A ray whose hits count before `t_max`, in lengths of `direction`.
struct Segment {
    vec3 origin;
    vec3 direction;
    float t_max;
    uint mask_seed; // decides hits on partly transparent surfaces
};

const float INFINITE_DISTANCE = 3e38; // stands for the distance of lights at infinity

// Optical depth of the walls that a shadow ray has passed, by channel, in 2^-20 of a halving. Integers have the same sum in whatever
// order a ray meets walls.
uvec3 wall_depth = uvec3(0u);
const float WALL_HALVING = 1048576.0; // units of `wall_depth`
const uint WALL_END = 25165824u;      // 24 halvings: what they leave counts as nothing

// Dims the light of a shadow ray to `share` of it. Returns whether any is left.
bool pass_wall(vec3 share) {
    vec3 halvings = clamp(-log2(max(share, 1e-9)), 0.0, 24.0);
    wall_depth = min(wall_depth + uvec3(halvings * WALL_HALVING + 0.5), WALL_END);
    return any(lessThan(wall_depth, uvec3(WALL_END)));
}

// What is left of `light` behind the walls.
vec3 behind_walls(vec3 light) {
    if (!FX_CLEAR_WALLS) return light;
    return mix(light * exp2(-vec3(wall_depth) / WALL_HALVING), vec3(0.0), equal(wall_depth, uvec3(WALL_END)));
}
