// Which thread this is, across a dispatch that may have been folded into rows: see Kernel::folded_groups. Threads beyond the work
// return at once. That is safe before no barrier(): kernels that have one (shared/block.glsl) say where they return all together.
layout(constant_id = 101) const uint WORKGROUP = 64; // as local_size_x; gl_WorkGroupSize is not kept up to date everywhere

uint group_index() { return gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x; }

uint thread_index() { return group_index() * WORKGROUP + gl_LocalInvocationID.x; }

// The same threads, groups dealt to STRIPES in turn: lavapipe gives each of its CPU threads one run of groups. If that were one
// part of the picture, some threads would have all of the sky, others all that is expensive to trace.
layout(constant_id = 104) const uint STRIPES = 1u;

uint striped_index() {
    uint groups = gl_NumWorkGroups.x * gl_NumWorkGroups.y, stripe = groups / STRIPES, group = group_index();
    group = group < stripe * STRIPES ? group % STRIPES * stripe + group / STRIPES : group;
    return group * WORKGROUP + gl_LocalInvocationID.x;
}
