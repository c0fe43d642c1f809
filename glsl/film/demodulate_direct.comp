#include "shared/thread.glsl"
#include "shared/noisy.glsl"
#include "shared/albedo.glsl"

// Divides the direct light of one pixel per thread by the albedo at the pixel's centre, so that textures stay sharp; light of
// pixels without albedo, such as lamps, stays as it is. Pixels without a finite value get count 0, and a filter in-paints them.
// Twin: denoise::twin::demodulate_direct.
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
