// The mean of linear models over a set of windows: slopes of the three channels, and the value at one point of the guide.
// The point moves with the pixel that is looked at, so that far-away guides keep their digits.
#include "shared/store64.glsl"

struct Fit {
    vec4 r;
    vec4 g;
    vec4 b;
    vec4 value; // rgb, windows
};

const int FIT = 4; // vec4s of a record, which are kept in pairs
const Fit NO_FIT = Fit(vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0));

// `at` counts pairs, and `step` is from one of a record to its next.
#define FIT_LOAD(at, step, FETCH) \
    Fit(FETCH(2 * (at)), FETCH(2 * (at) + 1), FETCH(2 * ((at) + step)), FETCH(2 * ((at) + step) + 1))
#define FIT_STORE(to, at, step, f) \
    to[at] = paired(f.r, f.g); \
    to[(at) + step] = paired(f.b, f.value)

Fit rebased(Fit f, vec4 by) {
    f.value.rgb += vec3(dot(f.r, by), dot(f.g, by), dot(f.b, by));
    return f;
}

// `f` with `other` if it `is` there, and as it was if not, whatever `other` holds then. Both about the same point.
void merge(inout Fit f, Fit other, bool is) {
    if (!is) other = Fit(f.r, f.g, f.b, vec4(f.value.rgb, 0.0));
    float count = other.value.w, all = f.value.w + count, share = count / max(all, 1.0);
    f.r += share * (other.r - f.r);
    f.g += share * (other.g - f.g);
    f.b += share * (other.b - f.b);
    f.value = vec4(f.value.rgb + share * (other.value.rgb - f.value.rgb), all);
}
