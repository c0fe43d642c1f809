// Which thread this is, across a dispatch that may have been folded into rows: see stage::groups.
layout(constant_id = 101) const uint WORKGROUP = 64; // as local_size_x; gl_WorkGroupSize is not kept up to date everywhere

uint thread_index() {
    return (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * WORKGROUP + gl_LocalInvocationID.x;
}
