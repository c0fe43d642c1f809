#include "shared/edge.glsl"

// Computes one lifting step of a decimated wavelet transform whose details are dropped, forward or inverse, for one pixel per
// thread. Odd pixels of a lattice are predicted from their even neighbours; even ones are updated by half the mean of the
// prediction errors. It is CDF(2,2) along rows and columns, or red-black (Uytterhoeven and Bultheel 1998) on the quincunx;
// with edge weights these are Fattal's (2009). Sums are of differences from the pixel, so that a constant image stays exact.
layout(local_size_x_id = 100) in;
#include "shared/packed_pixels.glsl"
layout(scalar, binding = 2) writeonly buffer Output { vec4 filtered[]; };
layout(scalar, push_constant) uniform Push { WaveletPush push; };

layout(constant_id = 114) const bool INVERSE = false;

// Four neighbours of a pixel for each stencil, in units of the spacing; rows and columns have two.
const ivec2 AROUND[16] = ivec2[](ivec2(-1, 0), ivec2(1, 0), ivec2(0), ivec2(0), ivec2(0, -1), ivec2(0, 1), ivec2(0), ivec2(0),
    ivec2(-1, 0), ivec2(1, 0), ivec2(0, -1), ivec2(0, 1), ivec2(-1, -1), ivec2(1, -1), ivec2(-1, 1), ivec2(1, 1));

Pixel pixel_at(ivec2 at) {
    ivec2 inside = clamp(at, ivec2(0), ivec2(push.size) - 1);
    int i = inside.y * int(push.size.x) + inside.x;
    Pixel p = pixel_at(i);
    if (at != inside) p.colour.w = 0.0;
    return p;
}

// Returns 0 for even pixels of the lattice, 1 for odd ones, and 2 for pixels that are not on it.
int parity(ivec2 at) {
    int s = int(push.spacing);
    ivec2 cell = at / s;
    bool on = at == cell * s;
    if (push.stencil == 0u) return on ? cell.x & 1 : 2;
    if (push.stencil == 1u) return on && (cell.x & 1) == 0 ? cell.y & 1 : 2;
    int colour = (cell.x + cell.y) & 1;
    if (push.stencil == 2u) return on ? colour : 2;
    return on && colour == 0 ? cell.x & 1 : 2;
}

ivec2 neighbour(ivec2 at, int i) {
    return at + int(push.spacing) * AROUND[4 * push.stencil + i];
}

// The difference of the neighbours' weighted mean from the pixel, and the sum of the weights.
vec4 prediction(ivec2 at, Pixel p) {
    vec3 sum = vec3(0.0);
    float total = 0.0;
    int count = push.stencil < 2u ? 2 : 4;
    for (int i = 0; i < count; i++) {
        Pixel q = pixel_at(neighbour(at, i));
        float w = edge_weight(q, edge_exponent(p, q, push.rates));
        sum += w * (q.colour.rgb - p.colour.rgb);
        total += w;
    }
    return total > 0.0 ? vec4(sum / total, total) : vec4(0.0);
}

// Half the weighted mean of the odd neighbours' prediction errors.
vec3 update(ivec2 at, Pixel p) {
    vec3 sum = vec3(0.0);
    float total = 0.0;
    int count = push.stencil < 2u ? 2 : 4;
    for (int i = 0; i < count; i++) {
        ivec2 there = neighbour(at, i);
        Pixel q = pixel_at(there);
        float w = edge_weight(q, edge_exponent(p, q, push.rates));
        sum -= w * prediction(there, q).rgb;
        total += w;
    }
    return total > 0.0 ? 0.5 * sum / total : vec3(0.0);
}

void main() {
    ivec2 size = ivec2(push.size), at = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(at, size))) return;
    Pixel p = pixel_at(at);
    vec4 c = p.colour;
    int odd = parity(at);
    bool known = c.w > 0.0;
    // An unknown even pixel takes the mean of its neighbours instead of an update.
    vec4 predicted = prediction(at, p);
    if ((INVERSE && odd == 1 || !INVERSE && odd == 0 && !known) && predicted.w > 0.0) {
        c = vec4(c.rgb + predicted.rgb, known ? c.w : 1.0);
    } else if (!INVERSE && odd == 0) { // adds 0 where no neighbour is alike
        c.rgb += update(at, p);
    }
    filtered[at.y * size.x + at.x] = c;
}
