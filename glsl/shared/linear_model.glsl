// The mean of linear models over a set of windows: the slopes of the three channels, and the value at one point of the guide.
// The point is close to the pixels in question, so that guides of large values keep their digits.
#include "shared/store64.glsl"

struct Fit {
    vec4 r;
    vec4 g;
    vec4 b;
    vec4 value; // rgb; w: number of windows
};

const int FIT = 4; // vec4s of a record, stored in pairs
const Fit NO_FIT = Fit(vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0));

// `at` is the index of a record's first pair, and `step` the distance from one pair to the next.
#define FIT_LOAD(at, step, FETCH) \
    Fit(FETCH(2 * (at)), FETCH(2 * (at) + 1), FETCH(2 * ((at) + step)), FETCH(2 * ((at) + step) + 1))
#define FIT_STORE(to, at, step, f) \
    to[at] = pack64(f.r, f.g); \
    to[(at) + step] = pack64(f.b, f.value)

Fit rebased(Fit f, vec4 by) {
    f.value.rgb += vec3(dot(f.r, by), dot(f.g, by), dot(f.b, by));
    return f;
}

// Merges `other` into `f` if it `exists`; if not, `other` may hold anything. Both have the same point.
void merge(inout Fit f, Fit other, bool exists) {
    if (!exists) other = Fit(f.r, f.g, f.b, vec4(f.value.rgb, 0.0));
    float count = other.value.w, all = f.value.w + count, share = count / max(all, 1.0);
    f.r += share * (other.r - f.r);
    f.g += share * (other.g - f.g);
    f.b += share * (other.b - f.b);
    f.value = vec4(f.value.rgb + share * (other.value.rgb - f.value.rgb), all);
}
