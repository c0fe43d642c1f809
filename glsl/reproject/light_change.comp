#include "shared/thread.glsl"

// Sums what the probes of 3x3 cells have found, `spacing` cells apart, and keeps the largest mean change so far that exceeds the
// noise of the differences. Level after level, with a spacing of 1, 3, 9, the windows grow to 27x27 cells. Small ones find a strong
// change where it is; large ones find a faint one, of which few paths tell.
layout(local_size_x_id = 100) in;
layout(binding = 0) uniform usamplerBuffer found; // of LightChange
layout(scalar, binding = 1) writeonly buffer Sums { LightChange sums[]; };
layout(scalar, push_constant) uniform Push { LightChangePush push; };

// A sum is noise up to so many of its standard deviations, which come from the sum of squares, as if the mean were 0: three paths
// that find the same are no chance. In windows of 9x9 cells a single path that finds much is believed: samples that are dropped in
// vain cost noise, those that are kept leave a ghost. Among 9 paths one says little of how much, among 729 little of where.
const float CERTAIN = 1.7;

void main() {
    uint i = thread_index();
    if (i >= push.cells.x * push.cells.y) return;
    ivec2 size = ivec2(push.cells), at = ivec2(i % push.cells.x, i / push.cells.x);
    LightChange sum = LightChange_zero();
    sum.error = LightChange_error(found, i);
    for (int k = 0; k < 9; k++) {
        ivec2 q = at + int(push.spacing) * ivec2(k % 3 - 1, k / 3 - 1);
        if (any(lessThan(q, ivec2(0))) || any(greaterThanEqual(q, size))) continue;
        LightChange other = LightChange_load(found, uint(q.y * size.x + q.x));
        sum.sum += other.sum;
        sum.squares += other.squares;
        sum.count += other.count;
    }
    vec3 change = abs(sum.sum), noise = push.spacing == 3u ? vec3(0.0) : CERTAIN * sqrt(sum.squares);
    change = mix(vec3(0.0), change / float(max(sum.count, 1u)), greaterThan(change, noise));
    sum.error = max(sum.error, max(change.r, max(change.g, change.b)));
    sums[i] = sum;
}
