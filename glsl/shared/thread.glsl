// Which thread this is, across a dispatch that may have been folded into rows: see stage::groups.

uint thread_index() {
    uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    return group * gl_WorkGroupSize.x + gl_LocalInvocationID.x;
}
