#include "shared/sanitise.glsl"
#include "shared/luminance.glsl"
#include "shared/dominated.glsl"

// Cuts outliers, one pixel per thread: those of more than push.factor times the luminance of the second brightest of the 24 pixels
// around them (a highlight does not stand alone) whose light one sample has brought, as their variance tells. The more samples,
// the brighter one must be to do so, and in the limit nothing is cut. Where fewer than two pixels around are known, or most are
// dark, nothing tells what is usual. Light may be negative, where some of it is kept apart (glsl/film/accumulate.comp): it counts as bright.
layout(local_size_x_id = 100) in;
layout(binding = 0) uniform samplerBuffer radiance; // of vec4
layout(scalar, binding = 1) buffer Variance { vec3 variance[]; };
layout(scalar, binding = 2) writeonly buffer Output { vec4 cut[]; };
layout(scalar, push_constant) uniform Push { FireflyPush push; };

layout(constant_id = 114) const bool MEASURED = true; // `variance` holds every pixel's

bool dominated(int i, float bright, float count) {
    if (!MEASURED || count < 2.0) return true; // one sample has brought it all
    vec3 v = variance[i];
    return finite(v) && luminance(sqrt(max(v, vec3(0.0)))) > DOMINATED * bright;
}

void main() {
    ivec2 size = ivec2(push.size), at = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(at, size))) return;
    int own = at.y * size.x + at.x;
    vec4 here = known_radiance(texelFetch(radiance, own));
    float first = -1.0, second = -1.0;
    int lit = 0, known = 0;
    for (int j = -2; j <= 2; j++) {
        for (int i = -2; i <= 2; i++) {
            ivec2 tap = at + ivec2(i, j), inside = clamp(tap, ivec2(0), size - 1);
            vec4 c = known_radiance(texelFetch(radiance, inside.y * size.x + inside.x));
            if (tap != inside || tap == at || c.w == 0.0) continue;
            float v = abs(luminance(c.rgb));
            second = max(second, min(first, v));
            first = max(first, v);
            lit += int(v > 0.0);
            known++;
        }
    }
    float most = push.factor * second, bright = abs(luminance(here.rgb));
    if (known >= 2 && 2 * lit > known && bright > most && dominated(own, bright, here.w)) {
        here.rgb *= most / bright;
        if (MEASURED) variance[own] *= most / bright * (most / bright);
    }
    cut[own] = here;
}
