#include "shared/thread.glsl"
#include "shared/luminance.glsl"
#include "shared/perturbation.glsl"

// Estimates, per pixel and thread, the leverage of a pixel in each candidate: the derivative of its filtered value by its own
// value, the diagonal of the matrix of a linear filter (Ramani, Blu, Unser 2008). The estimate also holds what the noise
// brings from neighbours, which is 0 on average. Larger windows keep next to nothing: as much less than the narrow one as they are
// larger.
layout(local_size_x = 64) in;
layout(binding = 0) uniform samplerBuffer wide; // of vec4, of the image
layout(binding = 1) uniform samplerBuffer svgf; // of vec4, of the image
layout(binding = 2) uniform samplerBuffer narrow_kept; // of vec4, of the signs
layout(binding = 3) uniform samplerBuffer svgf_kept; // of vec4, of the probed image
layout(scalar, binding = 4) writeonly buffer Output { vec4 leverages[]; };
layout(scalar, push_constant) uniform Push { AutoLeveragePush push; };

void main() {
    uint i = thread_index();
    if (i >= push.count) return;
    int at = int(i);
    float narrow = dot(texelFetch(narrow_kept, at).rgb, signs_of(i)) / 3.0;
    float added = perturbation(i, texelFetch(wide, at).rgb, push.floor);
    float grown = contrast(texelFetch(svgf_kept, at).rgb, texelFetch(svgf, at).rgb);
    leverages[i] = clamp(vec4(push.shares * narrow, narrow, grown / added), -1.0, 1.0);
}
