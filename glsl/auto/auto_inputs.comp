#include "shared/thread.glsl"
#include "shared/luminance.glsl"
#include "shared/candidates.glsl"
#include "shared/perturbation.glsl"
#include "shared/tiled_index.glsl"

// Makes, per pixel and thread, what the candidates filter besides the image: the dimmed image for the narrow window, and for svgf
// the image with a little known noise added, by which its leverages are measured (Monte Carlo divergence: Ramani, Blu, Unser 2008).
layout(local_size_x = 64) in;
layout(binding = 0) uniform samplerBuffer colour; // of vec4
layout(binding = 1) uniform samplerBuffer wide; // of vec4
layout(binding = 2) uniform samplerBuffer estimate; // of vec4, of svgf
layout(scalar, binding = 3) writeonly buffer Dim { vec4 dim[]; }; // as guided_pack.comp orders pixels
layout(scalar, binding = 4) writeonly buffer Probed { vec4 probed[]; }; // with the variance of the image
layout(scalar, push_constant) uniform Push { AutoPush push; };

void main() {
    uint i = thread_index();
    if (i >= push.size.x * push.size.y) return;
    vec4 c = texelFetch(colour, int(i));
    vec3 around = texelFetch(wide, int(i)).rgb;
    int x = int(i % push.size.x), y = int(i / push.size.x);
    dim[tiled_index(x, y, int(push.size.y))] = vec4(dimmed(c.rgb, around), c.w);
    probed[i] = vec4(c.rgb + perturbation(i, around, push.floor), texelFetch(estimate, int(i)).w);
}
