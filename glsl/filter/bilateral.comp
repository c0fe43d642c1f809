#include "shared/edge.glsl"

// Filters radiance by the bilateral filter (Tomasi and Manduchi 1998), evaluated over the whole window; it is a joint one
// where normals or positions have weights. A thread filters ROWS pixels of a column, which share nearly all their taps.
layout(local_size_x_id = 100) in;
#include "shared/packed_pixels.glsl"
layout(scalar, binding = 2) writeonly buffer Output { vec4 filtered[]; };
layout(scalar, binding = 3) buffer Sums { vec4 sums[]; };
layout(scalar, push_constant) uniform Push { BilateralPush push; };

// Whether the window is cut into bands of rows, with one dispatch per band that adds to `sums` (weighted differences,
// weights): see shared/loop_limit.glsl.
layout(constant_id = 115) const bool BANDS = false;

const int ROWS = 8;
const float REFUSED = -1e30; // exponent of weight 0

void main() {
    ivec2 size = ivec2(push.size);
    int x = int(gl_GlobalInvocationID.x), first = ROWS * int(gl_GlobalInvocationID.y), radius = int(push.radius);
    if (x >= size.x || first >= size.y) return;
    Pixel centre[ROWS];
    vec3 sum[ROWS];
    float total[ROWS];
    [[unroll]] for (int k = 0; k < ROWS; k++) {
        centre[k] = pixel_at(min(first + k, size.y - 1) * size.x + x);
        sum[k] = vec3(0.0);
        total[k] = 0.0;
        if (BANDS && push.band > 0u && first + k < size.y) {
            vec4 before = sums[(first + k) * size.x + x];
            sum[k] = before.rgb;
            total[k] = before.w;
        }
    }
    int top = max(first - radius, 0), bottom = min(first + ROWS - 1 + radius, size.y - 1);
    bool last = true;
    if (BANDS) {
        int begin = first - radius + int(push.band * push.band_rows), end = begin + int(push.band_rows);
        last = end > first + ROWS - 1 + radius;
        top = max(top, begin);
        bottom = min(bottom, end - 1);
    }
    // Tested at its end: see shared/traverse.glsl.
    int y = top;
    if (top <= bottom) do {
        int i = -radius;
        do {
            int tap_x = x + i;
            Pixel q = pixel_at(y * size.x + clamp(tap_x, 0, size.x - 1));
            bool counts = tap_x >= 0 && tap_x < size.x && q.colour.w > 0.0;
            float across = counts ? -push.rate_space * float(i * i) : REFUSED;
            [[unroll]] for (int k = 0; k < ROWS; k++) {
                int j = y - first - k;
                float along = abs(j) <= radius ? -push.rate_space * float(j * j) : REFUSED;
                float exponent = edge_exponent(centre[k], q, push.rates) + (across + along);
                float w = exponent > LEAST_EXPONENT ? exp2(exponent) : 0.0;
                sum[k] += w * (q.colour.rgb - centre[k].colour.rgb);
                total[k] += w;
            }
        } while (++i <= radius);
    } while (++y <= bottom);
    [[unroll]] for (int k = 0; k < ROWS; k++) {
        if (first + k >= size.y) continue;
        if (BANDS && !last) {
            sums[(first + k) * size.x + x] = vec4(sum[k], total[k]);
            continue;
        }
        vec4 c = centre[k].colour;
        if (total[k] > 0.0) c = vec4(c.rgb + sum[k] / total[k], c.w > 0.0 ? c.w : 1.0);
        filtered[(first + k) * size.x + x] = c;
    }
}
