// What all paths of a frame have in common. The command buffer writes the uniform buffer, so that a later frame does not change
// the camera of an earlier one. Needs `push` (PathPush) where PathConstants are read.
layout(scalar, binding = 15) uniform Frame { Camera camera; };
