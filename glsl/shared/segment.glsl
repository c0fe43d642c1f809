// A ray, and what it meets.

struct Hit {
    float t;          // distance in lengths of the ray's direction
    uint triangle;    // index in leaf order; NONE on a miss
    uint instance;    // NONE without instances
    float b1, b2;     // weights of vertices 1 and 2; of a sphere, see sphere.glsl
};

// Seeds of masks are even, but for shadow rays of lights without extent, which pass clear walls.
const uint PASSES_WALLS = 1u;

uint mask_bits(uint word) { return word & ~PASSES_WALLS; }

// A ray whose hits count before `t_max`, in lengths of `direction`.
struct Segment {
    vec3 origin;
    vec3 direction;
    float t_max;
    uint mask_seed; // decides hits on partly transparent surfaces
};

const float INFINITE_DISTANCE = 3e38; // stands for the distance of lights at infinity
