#include "shared/moments.glsl"
#include "shared/linear_model.glsl"

// Thread i merges a record whose numbers are all from[i] into a record of ones, once with `exists` false and once true, and
// writes the sum of all numbers of either result: results[4 i ..] = moments without, moments with, fits without, fits with.
layout(local_size_x = 64) in;
layout(scalar, binding = 0) readonly buffer From { float from[]; };
layout(scalar, binding = 1) writeonly buffer Results { float results[]; };
layout(scalar, push_constant) uniform Push { uint push; };

Moments moments_of(float v) {
    return Moments(vec4(1.0, vec3(v)), vec4(v), vec4(v), vec3(v), vec3(v), vec4(v), vec4(v), vec4(v));
}

Fit fit_of(float v) { return Fit(vec4(v), vec4(v), vec4(v), vec4(vec3(v), 1.0)); }

float sum(vec4 v) { return dot(v, vec4(1.0)); }

float sum(Moments m) {
    return sum(m.head) + sum(m.mean) + sum(m.xx) + sum(vec4(m.yy, 0.0)) + sum(vec4(m.zz, 0.0)) + sum(m.r) + sum(m.g) + sum(m.b);
}

float sum(Fit f) { return sum(f.r) + sum(f.g) + sum(f.b) + sum(f.value); }

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= push) return;
    Moments without = moments_of(1.0), with = without;
    Fit fit_without = fit_of(1.0), fit_with = fit_without;
    bool never = from[i] == -1.0; // false in the test, which the compiler cannot know
    merge(without, moments_of(from[i]), never);
    merge(with, moments_of(from[i]), !never);
    merge(fit_without, fit_of(from[i]), never);
    merge(fit_with, fit_of(from[i]), !never);
    results[4u * i] = sum(without);
    results[4u * i + 1u] = sum(with);
    results[4u * i + 2u] = sum(fit_without);
    results[4u * i + 3u] = sum(fit_with);
}
