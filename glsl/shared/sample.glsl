// What a path leaves behind: one vec4 (radiance), or three with FX_SPLIT (direct, indirect, the albedo to divide indirect by). With
// FX_SOFT what all but the key light brings to the first hit goes with indirect light, since it is as noisy. w of the first is the number of
// rays, negated where the sample is wrong: its light was not finite, and it is black, or its path `ended_early`. w of the last holds the
// bits of sample_marks.glsl.
#include "shared/sample_marks.glsl"
#include "shared/finite.glsl"
#include "shared/path_state.glsl"
#include "shared/counters.glsl"
#include "shared/store64.glsl"
layout(scalar, binding = 11) writeonly buffer Samples { u64vec2 samples[]; }; // of vec4
layout(scalar, binding = 14) buffer Broken { BrokenTally broken[]; };

void store_sample(uint i, uint pixel, PathState p, bool ended_early) {
    SplitLight light = light_of(p);
    float rays = float(p.closest_rays + p.any_rays);
    bool known = finite(light.direct + light.indirect);
    if (!known) light = SplitLight(vec3(0.0), vec3(0.0), vec3(0.0));
    if (!known || ended_early) {
        rays = -rays;
        atomicMax(broken[0].lowest, ~pixel);
    }
    if (FX_SPLIT) {
        samples[3u * i] = pack64(vec4(light.direct, rays));
        samples[3u * i + 1u] = pack64(vec4(light.indirect, 0.0));
        samples[3u * i + 2u] = pack64(vec4(p.albedo, float((p.share == 0.0 ? ASTRAY : 0u) | (p.passed_over ? PASSED_OVER : 0u))));
    } else {
        samples[i] = pack64(vec4(light.direct + light.indirect, rays));
    }
    if (FX_COUNTERS) {
        count_up(0u, p.closest_rays);
        count_up(1u, p.any_rays);
    }
}
