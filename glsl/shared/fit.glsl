// The mean of linear models over a set of windows: slopes of the three channels, and the value at one point of the
// guide. The point moves with the pixel that is looked at, so that far-away guides keep their digits.

struct Fit {
    vec4 r;
    vec4 g;
    vec4 b;
    vec4 value; // rgb, windows
};

const int FIT = 4; // vec4s of a record
const Fit NO_FIT = Fit(vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0));

#define FIT_LOAD(at, FETCH) Fit(FETCH(at), FETCH((at) + 1), FETCH((at) + 2), FETCH((at) + 3))
#define FIT_STORE(to, at, f) to[at] = f.r; to[(at) + 1] = f.g; to[(at) + 2] = f.b; to[(at) + 3] = f.value

void move(inout Fit f, vec4 by) {
    f.value.rgb += vec3(dot(f.r, by), dot(f.g, by), dot(f.b, by));
}

// Both about the same point.
void absorb(inout Fit f, Fit other) {
    float all = f.value.w + other.value.w, share = other.value.w / max(all, 1.0);
    f.r += share * (other.r - f.r);
    f.g += share * (other.g - f.g);
    f.b += share * (other.b - f.b);
    f.value = vec4(f.value.rgb + share * (other.value.rgb - f.value.rgb), all);
}
