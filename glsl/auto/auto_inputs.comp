#include "shared/thread.glsl"
#include "shared/luminance.glsl"
#include "shared/candidates.glsl"
#include "shared/perturbation.glsl"

// Makes, per pixel and thread, what the candidates filter besides the image: the dimmed image for the narrow window, and two
// known noises by which leverages are measured (Monte Carlo divergence: Ramani, Blu, Unser 2008). The guided filters are
// linear, so that they filter noise alone, independent in each of three channels. svgf depends on the image, and filters the
// image with a little noise added.
layout(local_size_x = 64) in;
layout(binding = 0) uniform samplerBuffer colour; // of vec4
layout(binding = 1) uniform samplerBuffer wide; // of vec4
layout(scalar, binding = 2) writeonly buffer Dim { vec4 dim[]; };
layout(scalar, binding = 3) writeonly buffer Signs { vec4 signs[]; };
layout(scalar, binding = 4) writeonly buffer Probed { vec4 probed[]; };
layout(scalar, push_constant) uniform Push { AutoPush push; };

void main() {
    uint i = thread_index();
    if (i >= push.count) return;
    vec4 c = texelFetch(colour, int(i));
    vec3 around = texelFetch(wide, int(i)).rgb;
    dim[i] = vec4(dimmed(c.rgb, around), c.w);
    signs[i] = vec4(signs_of(i), c.w);
    probed[i] = vec4(c.rgb + perturbation(i, around, push.floor), c.w);
}
