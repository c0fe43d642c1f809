// Paths that wait for their rays: two counts, then for either stage of two their numbers. Before their first rays all paths of a batch
// wait, in order.
#include "shared/which_path.glsl"
layout(scalar, binding = 17) buffer Queue { uint queue[]; };

uint waiting() { return push.stage == 0u ? path_count() : queue[push.stage & 1u]; }

uint list_of(uint stage) { return 2u + (stage & 1u) * path_count(); }

uint waiting_path(uint item) { return push.stage == 0u ? item : queue[list_of(push.stage) + item]; }

// Stages that read the other list are over when rays of this one are traced, and begin when that is done.
void empty_next_queue() { queue[(push.stage + 1u) & 1u] = 0u; }

void wait_for_rays(uint i) {
    uint next = push.stage + 1u;
    queue[list_of(next) + atomicAdd(queue[next & 1u], 1u)] = i;
}
