// Index of a thread in a dispatch whose workgroups may lie in several rows (Kernel::folded_groups). Kernels without barrier()
// let threads beyond the work return at once; those with one (shared/block.glsl) return only where all threads do.
layout(constant_id = 101) const uint WORKGROUP = 64; // as local_size_x; gl_WorkGroupSize is not kept up to date everywhere

uint group_index() { return gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x; }

uint thread_index() { return group_index() * WORKGROUP + gl_LocalInvocationID.x; }
