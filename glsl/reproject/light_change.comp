#include "shared/thread.glsl"
#include "shared/largest_channel.glsl"

// Sums what the probes of 3x3 cells have found, `spacing` cells apart, and keeps the largest change so far, as a share of the
// light. Level after level, with a spacing of 1, 3, 9, the windows grow to 27x27 cells. Small ones find a strong change where it
// is; large ones find one of which few paths tell.
layout(local_size_x_id = 100) in;
layout(binding = 0) uniform usamplerBuffer found; // of LightChange
layout(scalar, binding = 1) writeonly buffer Sums { LightChange sums[]; };
layout(scalar, push_constant) uniform Push { LightChangePush push; };

// Both paths of a probe have the same random numbers, so that they differ only where light has changed. In windows of 3x3 cells
// differences count by their size, since a narrow shadow that moves on takes as much light as it gives back. There a
// single path would stand for a ninth of the light: the squared sum loses what each path alone has. Among 81 and 729 paths one counts as
// it is, with its sign: it stands for little, and noise cancels.
const uint LEAST_SPACING = 1u;

// A change without noise at one path (`change` of the first level) counts in a square of so many cells across around it, since few of
// their paths meet the narrow edge of a shadow that passes there.
const int CERTAIN_ACROSS = 5;

void main() {
    uint i = thread_index();
    if (i >= push.cells.x * push.cells.y) return;
    ivec2 size = ivec2(push.cells), at = ivec2(i % push.cells.x, i / push.cells.x);
    LightChange all = LightChange_zero();
    float certain = 0.0;
    for (int k = 0; k < 9; k++) {
        ivec2 q = at + int(push.spacing) * ivec2(k % 3 - 1, k / 3 - 1);
        if (any(lessThan(q, ivec2(0))) || any(greaterThanEqual(q, size))) continue;
        LightChange other = LightChange_load(found, uint(q.y * size.x + q.x));
        all.sum += other.sum;
        all.squares += other.squares;
        all.size += other.size;
        all.light += other.light;
        all.count += other.count;
    }
    for (int k = 0; k < CERTAIN_ACROSS * CERTAIN_ACROSS && push.spacing == LEAST_SPACING; k++) {
        ivec2 q = at + ivec2(k % CERTAIN_ACROSS, k / CERTAIN_ACROSS) - CERTAIN_ACROSS / 2;
        if (any(lessThan(q, ivec2(0))) || any(greaterThanEqual(q, size))) continue;
        certain = max(certain, LightChange_change(found, uint(q.y * size.x + q.x)));
    }
    vec3 sum = abs(all.sum);
    float together = sqrt(max(all.size * all.size - all.squares, 0.0));
    float change = push.spacing == LEAST_SPACING ? together : largest_channel(sum);
    float before = push.spacing == LEAST_SPACING ? certain : LightChange_change(found, i);
    all.change = max(before, change > 0.0 ? change / all.light : 0.0);
    sums[i] = all;
}
