// A path as it leaves the camera. Needs which_path.glsl, camera.glsl and path_state.glsl before it.

PathState eye_path(uint pixel, uint index, Sampler random) {
    Ray eye = eye_ray(film_sample(pixel, random), random);
    return path_state(eye.origin, eye.direction, FX_SPARSE && !is_traced_whole(pixel), path_seed(pixel, index));
}
