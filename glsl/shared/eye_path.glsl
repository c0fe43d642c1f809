// A path as it leaves the camera.
#include "shared/which_path.glsl"
#include "shared/camera.glsl"
#include "shared/path_state.glsl"

PathState eye_path(uint pixel, uint index, Sampler random) {
    Ray eye = eye_ray(film_sample(pixel, random), random);
    return path_state(eye.origin, eye.direction, FX_SPARSE && !is_traced_whole(pixel), path_seed(pixel, index));
}
