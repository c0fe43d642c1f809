#include "shared/thread.glsl"
#include "shared/luminance.glsl"
#include "shared/candidates.glsl"
#include "shared/perturbation.glsl"

// What the candidates are run on besides the image: what the narrow window gets of it, and two known noises, of which a filter
// keeps its divergence (Ramani, Blu, Unser 2008). Windows of fits are linear: noise alone tells what they keep, three times
// by three channels. What svgf keeps depends on the image, to which a little is added.
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
    probed[i] = vec4(c.rgb + probe(i, around, push.floor), c.w);
}
