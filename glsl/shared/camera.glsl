// Camera rays.
#include "shared/frame.glsl"
#include "shared/sampler.glsl"
#include "shared/segment.glsl"
#include "shared/warp.glsl"

struct Ray {
    vec3 origin;
    vec3 direction; // unit
};

// Converts film coordinates from pixels (x right, y down) to [-1, 1] (right, up).
vec2 film_from_pixel(vec2 pixel, uvec2 size) {
    return vec2(2.0, -2.0) * pixel / vec2(size) + vec2(-1.0, 1.0);
}

// Ray through `film` in [-1, 1]; `lens` in [0, 1)^2 matters only where the scene has a lens.
Ray camera_ray(Camera camera, vec2 film, vec2 lens) {
    vec3 through = camera.forward + film.x * camera.right + film.y * camera.up;
    vec3 origin = camera.position;
    if (FX_ORTHOGRAPHIC && camera.orthographic != 0u) {
        origin += film.x * camera.right + film.y * camera.up;
        through = camera.forward;
    }
    if (FX_LENS) {
        vec2 disk = camera.lens_radius * warp_disk(lens);
        vec3 shift = disk.x * normalize(camera.right) + disk.y * normalize(camera.up);
        origin += shift;
        through -= shift / max(camera.focus_distance, 1e-20); // a lens of radius 0 changes no bit
    }
    vec3 direction = normalize(through);
    return Ray(origin + camera.near * direction, direction);
}

// Dimension pairs of the camera; scattering events use the pairs after them.
const uint PAIR_FILM = 0u, PAIR_LENS = 1u;

// Position on the film of a sample of `pixel`, in pixels.
vec2 film_sample(uint pixel, Sampler random) {
    vec2 at = vec2(pixel % push.constants.size.x, pixel / push.constants.size.x);
    vec2 u = sample_2d(random, PAIR_FILM);
    if (FX_PIXEL_FILTER && push.constants.pixel_filter == PIXEL_FILTER_TENT) u = 0.5 + vec2(warp_tent(u.x), warp_tent(u.y));
    else if (FX_PIXEL_FILTER && push.constants.pixel_filter == PIXEL_FILTER_GAUSSIAN) u = 0.5 + vec2(warp_gaussian(u.x), warp_gaussian(u.y));
    else if (FX_PIXEL_FILTER && push.constants.pixel_filter == PIXEL_FILTER_POINT) u = vec2(0.5);
    return at + u;
}

// The first ray of a sample's path, through `film` in pixels.
Ray eye_ray(vec2 film, Sampler random) {
    vec2 lens = FX_LENS ? sample_2d(random, PAIR_LENS) : vec2(0.0);
    return camera_ray(camera, film_from_pixel(film, push.constants.size), lens);
}

// Seed of the alpha masks along a path. The frame's seed is hashed, or seeds 0 and 1 would swap the numbers of neighbouring
// pixels; it is inverted, or the numbers would be those of `sampler_start`.
uint path_seed(uint pixel, uint index) {
    uint hash = pcg(pixel ^ pcg(~push.constants.seed));
    if (index > 0xffffu) hash = pcg(hash + (index >> 16)); // MASK_INDEX has room for so many
    return ((FX_INDEPENDENT ? pcg(hash + index) : bitfieldReverse(index)) & MASK_INDEX) | (hash & MASK_HASH) | BY_CHANCE;
}
