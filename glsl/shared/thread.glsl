// Which thread this is, across a dispatch that may have been folded into rows: see stage::groups.
layout(constant_id = 101) const uint WORKGROUP = 64; // as local_size_x; gl_WorkGroupSize is not kept up to date everywhere

uint group_index() { return gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x; }

uint thread_index() { return group_index() * WORKGROUP + gl_LocalInvocationID.x; }

// The same threads, groups dealt to STRIPES in turn: lavapipe gives each of its threads one run of groups, which has
// the sky of a picture, or what is dear to trace, unless it goes through all of the picture.
layout(constant_id = 104) const uint STRIPES = 1u;

uint striped_index() {
    uint groups = gl_NumWorkGroups.x * gl_NumWorkGroups.y, stripe = groups / STRIPES, group = group_index();
    group = group < stripe * STRIPES ? group % STRIPES * stripe + group / STRIPES : group;
    return group * WORKGROUP + gl_LocalInvocationID.x;
}
