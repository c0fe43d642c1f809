#include "shared/thread.glsl"
#include "shared/noisy.glsl"
#include "shared/albedo.glsl"

// Direct light before the albedo of the pixels' centres, so that textures stay sharp, and as it is where that is 0, as on a
// lamp. Pixels that have none of their own get count 0, and a filter in-paints them. Twin: denoise::twin::demodulate_direct.
layout(local_size_x = 64) in;
layout(scalar, binding = 3) writeonly buffer Direct { vec4 direct[]; };
layout(scalar, push_constant) uniform Push { PackPush push; };

void main() {
    uint i = thread_index();
    if (i >= push.count) return;
    vec3 own = PixelLight_direct(light, int(i)), albedo = albedo_at(int(i));
    float count = count_at(int(i));
    vec3 before_albedo = reflects(albedo) ? own / divisor(albedo) : own;
    direct[i] = count != 0.0 && finite(own) ? vec4(before_albedo, count) : vec4(0.0);
}
