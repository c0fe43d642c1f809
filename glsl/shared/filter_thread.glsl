// Threads of a filter whose workgroup is a piece of a row of the image: gl_GlobalInvocationID.x is the column of a thread's pixel,
// or of its pixels.
layout(local_size_x_id = 100) in;
layout(constant_id = 101) const uint WORKGROUP = 32; // as local_size_x
