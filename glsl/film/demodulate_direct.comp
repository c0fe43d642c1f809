#include "shared/thread.glsl"
#include "shared/noisy.glsl"
#include "shared/albedo.glsl"

// Divides the direct light of one pixel per thread by albedo, so that textures stay sharp; light of pixels without albedo, such as
// lamps, stays as it is. Pixels without a finite value get count 0, and a filter in-paints them. Those that show a surface in part
// and beside it sky or a lamp, whose light is not for that part's albedo to divide, get a negative count: they keep what they have,
// and no other pixel takes it. So do those whose samples all passed over the key light. Twin: denoise::twin::demodulate_direct.
layout(local_size_x = 64) in;
layout(scalar, binding = 3) writeonly buffer Direct { vec4 direct[]; };
layout(scalar, push_constant) uniform Push { SizePush push; };

bool shows_in_part(int i, vec3 albedo) {
    ivec2 size = ivec2(push.size), at = ivec2(i % size.x, i / size.x);
    bool partly = false, beside = false;
    for (int k = 0; k < 9; k++) {
        ivec2 tap = at + ivec2(k % 3, k / 3) - 1;
        if (k == 4 || any(lessThan(tap, ivec2(0))) || any(greaterThanEqual(tap, size))) continue;
        vec3 theirs = albedo_at(tap.y * size.x + tap.x);
        partly = partly || largest(albedo) < WHOLE * largest(theirs);
        beside = beside || !reflects(theirs);
    }
    return reflects(albedo) && partly && beside;
}

void main() {
    uint i = thread_index();
    if (i >= push.size.x * push.size.y) return;
    vec3 own = PixelLight_direct(light, int(i)), albedo = albedo_at(int(i));
    float count = count_at(int(i));
    vec3 before_albedo = reflects(albedo) ? own / divisor(albedo) : own;
    bool known = count != 0.0 && finite(own);
    bool keeps = passed_over(int(i)) || shows_in_part(int(i), albedo);
    direct[i] = !known ? vec4(0.0) : keeps ? vec4(vec3(0.0), -count) : vec4(before_albedo, count);
}
