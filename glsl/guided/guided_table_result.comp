#include "shared/linear_model.glsl"
#include "shared/sanitise.glsl"
#include "shared/tiled_index.glsl"

// Last pass of the guided filter with tables: evaluates the mean model of all windows that cover a pixel, one per thread, from
// the corners of a summed-area table.
layout(local_size_x = 32) in;
layout(binding = 0) uniform samplerBuffer table; // of vec4
layout(binding = 1) uniform samplerBuffer channels; // of vec4
layout(binding = 2) uniform samplerBuffer colour; // of vec4
layout(scalar, binding = 3) writeonly buffer Output { u64vec2 filtered[]; }; // of vec4
layout(scalar, push_constant) uniform Push { GuidedPush push; };

#include "shared/summed_area.glsl"
#define SUM(member) window_sum(c, FIT, member)

void main() {
    ivec2 size = ivec2(push.size), at = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(at, size))) return;
    ivec4 c = corners(at, size, int(push.radius));
    int from = tiled_index(at.x, at.y, size.y);
    Fit f = rebased(FIT_LOAD(0, 1, SUM), texelFetch(channels, from));
    vec4 here = texelFetch(colour, from);
    vec3 result = f.value.rgb / f.value.w;
    // The pixel stays as it is where the model overflows or no known pixel is within reach.
    bool usable = f.value.w > 0.0 && finite(result);
    filtered[at.y * size.x + at.x] = pack64(usable ? vec4(result, here.w > 0.0 ? here.w : 1.0) : here);
}
