// Index of a thread in a dispatch whose workgroups may lie in several rows (Kernel::folded_groups). Kernels without barrier()
// let threads beyond the work return at once; those with one (shared/block.glsl) return only where all threads do.
layout(constant_id = 101) const uint WORKGROUP = 64; // as local_size_x; gl_WorkGroupSize is not kept up to date everywhere

uint group_index() { return gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x; }

uint thread_index() { return group_index() * WORKGROUP + gl_LocalInvocationID.x; }

// A permutation of thread_index that deals workgroups to STRIPES parts in turn. lavapipe gives each CPU thread one run of
// consecutive groups; without stripes some threads would trace sky only, and others all that is expensive. A GPU has one stripe.
layout(constant_id = 104) const uint STRIPES = 1u;

uint striped_index() {
    uint groups = gl_NumWorkGroups.x * gl_NumWorkGroups.y, stripe = groups / STRIPES, group = group_index();
    group = group < stripe * STRIPES ? group % STRIPES * stripe + group / STRIPES : group;
    return group * WORKGROUP + gl_LocalInvocationID.x;
}
