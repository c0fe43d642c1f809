#include "shared/edge.glsl"
#include "shared/atrous_taps.glsl"

// Filters radiance by one level of the edge-avoiding A-Trous wavelet transform (Dammertz et al. 2010, section 2.2): 5x5 taps
// that are push.spacing pixels apart, each weighted by how alike the two pixels are and by its number of samples. A thread
// filters ROWS pixels of a column.
layout(local_size_x_id = 100) in;
#include "shared/packed_pixels.glsl"
layout(scalar, binding = 2) writeonly buffer Output { vec4 filtered[]; };
layout(scalar, push_constant) uniform Push { AtrousPush push; };

layout(constant_id = 114) const bool CONSERVE = false; // weight that a neighbour lacks goes to the centre

const float MOST_SAMPLES = 1e12; // larger counts are cut, so that sums stay finite

// Departure from the paper, for images whose pixels differ in samples. If geometry placed the samples, pixels have like noise,
// and the number of samples is the best weight; if noise placed them, the means have like errors, and equal weights are best.
// The root serves both.
float trust(Pixel q) { return CONSERVE ? 1.0 : sqrt(min(q.colour.w, MOST_SAMPLES)); }

void main() {
    ivec2 size = ivec2(push.size);
    int spacing = int(push.spacing), x = int(gl_GlobalInvocationID.x), column = int(gl_GlobalInvocationID.y);
    int first = first_row(column, spacing);
    if (x >= size.x || first >= size.y) return;
    Pixel centre[ROWS];
    vec3 sum[ROWS];
    float total[ROWS];
    [[unroll]] for (int k = 0; k < ROWS; k++) {
        centre[k] = pixel_at(min(first + k * spacing, size.y - 1) * size.x + x);
        sum[k] = vec3(0.0);
        total[k] = 0.0;
    }
    // Tested at its end: see shared/traverse.glsl.
    int i = -2;
    do {
        int tap_x = x + i * spacing;
        float across = tap_x >= 0 && tap_x < size.x ? b3_spline(i) : 0.0;
        tap_x = clamp(tap_x, 0, size.x - 1);
        [[unroll]] for (int j = -2; j < ROWS + 2; j++) {
            int y = first + j * spacing, inside = clamp(y, 0, size.y - 1);
            Pixel q = pixel_at(inside * size.x + tap_x);
            float h = y == inside ? across * trust(q) : 0.0; // pixels beyond the image do not count
            [[unroll]] for (int k = 0; k < ROWS; k++) { // constant bounds, or it would not be unrolled
                if (abs(j - k) <= 2) {
                    float w = h * b3_spline(j - k) * edge_weight(q, edge_exponent(centre[k], q, push.rates));
                    sum[k] += w * (q.colour.rgb - centre[k].colour.rgb);
                    total[k] += w;
                }
            }
        }
    } while (++i <= 2);
    [[unroll]] for (int k = 0; k < ROWS; k++) {
        int y = first + k * spacing;
        vec4 c = centre[k].colour;
        // Relative to the centre, so that a constant image comes back exactly.
        bool keep = CONSERVE && c.w > 0.0;
        if (total[k] > 0.0) c = vec4(c.rgb + sum[k] / (keep ? 1.0 : total[k]), c.w > 0.0 ? c.w : 1.0);
        if (y < size.y) filtered[y * size.x + x] = c;
    }
}
