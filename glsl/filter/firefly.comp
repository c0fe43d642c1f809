#include "shared/sanitise.glsl"
#include "shared/luminance.glsl"

// Cuts one pixel per thread to push.factor times the luminance of the second brightest of the 24 pixels around it: an outlier
// stands alone, a highlight does not. Pixels with fewer than two known neighbours stay as they are.
layout(local_size_x = 32) in;
layout(binding = 0) uniform samplerBuffer radiance; // of vec4
layout(scalar, binding = 1) writeonly buffer Output { vec4 cut[]; };
layout(scalar, push_constant) uniform Push { FireflyPush push; };

void main() {
    ivec2 size = ivec2(push.size), at = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(at, size))) return;
    vec4 here = known_radiance(texelFetch(radiance, at.y * size.x + at.x));
    float first = -1.0, second = -1.0;
    for (int j = -2; j <= 2; j++) {
        for (int i = -2; i <= 2; i++) {
            ivec2 tap = at + ivec2(i, j), inside = clamp(tap, ivec2(0), size - 1);
            vec4 c = known_radiance(texelFetch(radiance, inside.y * size.x + inside.x));
            bool counts = tap == inside && tap != at && c.w > 0.0;
            float v = counts ? max(luminance(c.rgb), 0.0) : -1.0;
            second = max(second, min(first, v));
            first = max(first, v);
        }
    }
    float most = push.factor * second, bright = luminance(here.rgb);
    if (second >= 0.0 && bright > most) here.rgb *= most / bright;
    cut[at.y * size.x + at.x] = here;
}
