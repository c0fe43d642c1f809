#include "shared/sanitise.glsl"

// Raises, in place, what a filter has made negative to the least known light of 7x7 pixels around, or to 0 where none of that is
// negative: linear fits and wavelets overshoot beside edges. A thread takes one pixel. Twin: denoise::filter::as_light.
layout(local_size_x = 8, local_size_y = 8) in;
layout(binding = 0) uniform samplerBuffer radiance; // of vec4
layout(scalar, binding = 1) buffer Output { vec4 filtered[]; };
layout(scalar, push_constant) uniform Push { SizePush push; };

const int REACH = 3; // pixels from the centre to the border of the window

void main() {
    ivec2 size = ivec2(push.size), at = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(at, size))) return;
    int i = at.y * size.x + at.x;
    vec4 result = filtered[i];
    if (all(greaterThanEqual(result.rgb, vec3(0.0)))) return;
    vec3 least = vec3(0.0);
    for (int k = 0; k < (2 * REACH + 1) * (2 * REACH + 1); k++) {
        ivec2 tap = clamp(at + ivec2(k % (2 * REACH + 1), k / (2 * REACH + 1)) - REACH, ivec2(0), size - 1);
        least = min(least, known_radiance(texelFetch(radiance, tap.y * size.x + tap.x)).rgb);
    }
    filtered[i] = vec4(max(result.rgb, least), result.w);
}
