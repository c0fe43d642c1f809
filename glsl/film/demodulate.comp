#include "shared/thread.glsl"
#include "shared/sanitise.glsl"

// Takes a frame apart for a filter: colour = sharp + factor * filtered. Twin: composition::split.
layout(local_size_x = 64) in;
const uint LIGHT = 0u, ALBEDO = 1u; // composition::Demodulation
layout(constant_id = 110) const uint DEMODULATION = LIGHT;
layout(binding = 0) uniform usamplerBuffer stats; // of PixelStats
layout(binding = 1) uniform usamplerBuffer light; // of PixelLight
layout(binding = 2) uniform usamplerBuffer guide; // of Guide
layout(scalar, binding = 3) writeonly buffer Radiance { vec4 radiance[]; };
layout(scalar, binding = 4) writeonly buffer Variance { vec3 variance[]; };
layout(scalar, binding = 5) writeonly buffer Factor { vec4 factor[]; };
layout(scalar, binding = 6) writeonly buffer Sharp { vec4 sharp[]; };
layout(scalar, push_constant) uniform Push { SplitPush push; };

// A channel of smaller albedo is divided by this instead; a pixel with no larger one is left as it is.
const float SMALLEST_ALBEDO = 0.01;
// A pixel with less than this part of its neighbours' albedo may show a piece of something that has none.
const float WHOLE = 0.98;
// And one with this many times the light of its neighbours.
const float OUTLIER = 2.0;

struct Parts {
    vec3 filtered;
    vec3 factor;
    vec3 sharp;
};

vec3 colour_at(int i) { return PixelStats_mean(stats, i); }

vec3 albedo_at(int i) { return Guide_albedo(guide, i); }

// 0 for what is no number.
float number(float v) { return finite(v) ? v : 0.0; }

vec3 number(vec3 v) { return vec3(number(v.x), number(v.y), number(v.z)); }

float largest(vec3 v) {
    v = number(v);
    return max(max(v.x, v.y), max(v.z, 0.0));
}

// The albedo of the samples; that of the pixel's centre where no sample met light.
float factor_of_samples(float colour, float direct, float indirect, float albedo) {
    float of_samples = (colour - direct) / indirect;
    return finite(of_samples) && indirect > 0.0 ? clamp(of_samples, 0.0, 1.0) : number(albedo);
}

Parts split_light(int i) {
    vec3 colour = colour_at(i), albedo = albedo_at(i);
    PixelLight l = PixelLight_load(light, i);
    Parts p = Parts(l.indirect, vec3(0.0), number(l.direct));
    for (int k = 0; k < 3; k++) {
        p.factor[k] = factor_of_samples(colour[k], l.direct[k], l.indirect[k], albedo[k]);
    }
    return p;
}

// Beside something brighter that reflects nothing, and partly of it.
bool is_rim(int i, vec3 colour, vec3 albedo) {
    ivec2 size = ivec2(push.size), at = ivec2(i % size.x, i / size.x);
    float bright = largest(colour), own = largest(albedo), others[8];
    int count = 0;
    bool outshone = false, partly = false;
    for (int k = 0; k < 9; k++) {
        ivec2 tap = at + ivec2(k % 3, k / 3) - 1;
        if (k == 4 || any(lessThan(tap, ivec2(0))) || any(greaterThanEqual(tap, size))) continue;
        int q = tap.y * size.x + tap.x;
        float their_albedo = largest(albedo_at(q)), their_light = largest(colour_at(q));
        partly = partly || own < WHOLE * their_albedo;
        if (their_albedo <= SMALLEST_ALBEDO) {
            outshone = outshone || their_light > bright;
            continue;
        }
        int place = count++; // insertion keeps them in order
        for (; place > 0 && others[place - 1] > their_light; place--) others[place] = others[place - 1];
        others[place] = their_light;
    }
    float median = count > 0 ? others[count / 2] : 0.0;
    return outshone && (bright > OUTLIER * median || partly);
}

Parts split_albedo(int i) {
    vec3 colour = colour_at(i), albedo = albedo_at(i);
    if (largest(albedo) <= SMALLEST_ALBEDO || is_rim(i, colour, albedo)) return Parts(vec3(0.0), vec3(0.0), number(colour));
    vec3 factor = max(number(albedo), vec3(SMALLEST_ALBEDO));
    return Parts(colour / factor, factor, vec3(0.0));
}

Parts demodulated(int i) {
    if (DEMODULATION == LIGHT) return split_light(i);
    if (DEMODULATION == ALBEDO) return split_albedo(i);
    return Parts(colour_at(i), vec3(1.0), vec3(0.0));
}

// Of the mean. That of indirect light is known of its luminance.
vec3 variance_of_filtered(int i, vec3 factor, float freedom) {
    if (DEMODULATION == LIGHT) return vec3(PixelLight_indirect_m2(light, i) / freedom);
    vec3 of_mean = PixelStats_m2(stats, i) / freedom;
    return mix(vec3(0.0), of_mean / (factor * factor), greaterThan(factor, vec3(0.0)));
}

void main() {
    uint i = thread_index();
    if (i >= push.size.x * push.size.y) return;
    uint count = PixelStats_count(stats, i);
    Parts p = demodulated(int(i));
    // Pixels whose filtered part is not used must not reach others.
    bool known = finite(colour_at(int(i))) && any(greaterThan(p.factor, vec3(0.0)));
    radiance[i] = vec4(p.filtered, known ? float(count) : 0.0);
    float freedom = count > 1u ? float(count) * float(count - 1u) : 0.0;
    variance[i] = freedom > 0.0 ? variance_of_filtered(int(i), p.factor, freedom) : vec3(0.0);
    factor[i] = vec4(p.factor, 0.0);
    sharp[i] = vec4(p.sharp, 0.0);
}
