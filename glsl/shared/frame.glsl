// What all paths of a frame have in common. The command buffer writes the uniform buffer, so that a later frame does not change
// the camera of an earlier one. Needs `push` (PathPush) where PathConstants are read.
layout(scalar, binding = 15) uniform Frame { Camera camera; };

// Width of a pixel in the middle of the film, at distance 1 or, where rays are parallel, at any.
float pixel_width(Camera camera, uvec2 size) {
    return 2.0 * max(length(camera.right) / float(size.x), length(camera.up) / float(size.y));
}
