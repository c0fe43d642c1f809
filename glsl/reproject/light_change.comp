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
// differences count by their size, since a narrow shadow that moves on takes as much light as it gives back; in larger ones with their
// sign, so that noise cancels. The squared sum loses what each path alone has: the rest is without bias the square of what is expected, and
// one bright path among 81, which tells of its own noise alone, is no change. Among 729 one counts as it is: it stands for little, and of
// light that few paths meet no others tell.
const uint LEAST_SPACING = 1u, WIDEST_SPACING = 9u;

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
    float total = push.spacing == LEAST_SPACING ? all.size : largest_channel(abs(all.sum));
    float own = push.spacing == WIDEST_SPACING ? 0.0 : all.squares;
    float change = sqrt(max(total * total - own, 0.0));
    float before = push.spacing == LEAST_SPACING ? certain : LightChange_change(found, i);
    all.change = max(before, change > 0.0 ? change / all.light : 0.0);
    sums[i] = all;
}
