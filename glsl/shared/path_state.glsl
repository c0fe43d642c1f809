// What a path takes from one surface to the next, and what light it has found. Needs `push` (PathPush).
#include "shared/largest_channel.glsl"
#include "shared/pcg.glsl"
#include "shared/segment.glsl"

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
    vec3 soft; // with FX_SOFT what all but the key light brings to the first hit, until the path's end; else zero
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
uint kind_of_light(uint scattered, bool chosen) {
    if (scattered == 0u) return chosen ? SOFT : DIRECT;
    return scattered >= 2u ? INDIRECT : SOFT;
}

// Clamps the largest channel of a whole sample, not of each bounce: the limit is that of the values which a pixel averages.
vec3 clamped(vec3 light) {
    float largest = largest_channel(light);
    return light * (push.constants.clamp_indirect > 0.0 && largest > push.constants.clamp_indirect ? push.constants.clamp_indirect / largest : 1.0);
}

// What a path takes from one surface to the next.
struct PathState {
    Path path;
    Hit hit;         // of the surface that it is at, or that its rays leave
    uint seed;       // of masks
    bool sharp_only; // ends where no light but such as a filter takes can come any more: the filter fills that in
    uint bounce;     // surfaces that it has left
    uint scattered;  // those of them that are not smooth
    float share;     // probability of its way, where smooth ones before these let it take one of two: 0 beyond one less likely than not
    bool passed_over; // the key light, if the first surface that is not smooth has one: another was chosen there
    uint closest_rays, any_rays;
    SplitLight light;
    vec3 albedo;     // what light is multiplied by on its way from what the path sees: see `seen_albedo`
};

// The rays that leave a surface: whether there is the one towards a light, with what comes along it if nothing blocks it, and
// whether the path goes on.
struct Departure {
    Segment shadow;
    vec3 sampled;
    bool shadowed;
    float certainty; // the probability that it was chosen, if it brings sharp shadows; else 0
    uint chosen;     // its index
    float kept;      // with FX_SOFT the share of `sampled` that is kept apart: 0 but for the key light
    bool passed_over; // whether there is a key light, and it is not that
    bool alive;
};

// That of a path that sets out from the camera.
PathState path_state(vec3 origin, vec3 direction, bool sharp_only, uint seed) {
    SplitLight none = SplitLight(vec3(0.0), vec3(0.0), vec3(0.0));
    Path path = Path(origin, direction, vec3(1.0), 0.0, true, 1.0);
    return PathState(path, Hit(0.0, NONE, NONE, 0.0, 0.0), seed, sharp_only, 0u, 0u, 1.0, false, 1u, 0u, none, vec3(0.0));
}

// The ray from the camera, or to the next surface.
Segment next_segment(PathState p) {
    return Segment(p.path.origin, p.path.direction, INFINITE_DISTANCE, path_mask_seed(p.seed, p.bounce));
}

// Adds what was sampled at the surface that the path has left, where nothing blocks it. What the key light brings is what it would if all
// paths chose it: of paths that choose another nothing is noted (PASSED_OVER). Only what the choice adds to it is noisy.
void add_sampled(inout PathState p, Departure d, vec3 sampled, bool lit) {
    vec3 light = lit ? sampled : vec3(0.0);
    float kept = FX_SOFT && p.scattered == 1u ? d.kept : 0.0;
    add_light(p.light, kept * light, DIRECT);
    add_light(p.light, (1.0 - kept) * light, kind_of_light(p.scattered, p.share < 1.0));
}

// The light of a path that has ended.
SplitLight light_of(PathState p) {
    SplitLight sum = p.light;
    if (FX_CLAMP) sum.indirect = clamped(sum.indirect);
    if (FX_SOFT) sum.indirect += sum.soft;
    if (FX_SPARSE && p.sharp_only) sum.indirect = vec3(0.0);
    return sum;
}
