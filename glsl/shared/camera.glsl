// Camera rays. Needs sampler.glsl and warp.glsl before it.

struct Ray {
    vec3 origin;
    vec3 direction; // unit
};

// Film coordinates in pixels (x right, y down) to [-1, 1] (right, up).
vec2 film_from_pixel(vec2 pixel, uvec2 size) {
    return vec2(2.0, -2.0) * pixel / vec2(size) + vec2(-1.0, 1.0);
}

// `lens` in [0, 1)^2 is read only where the scene has a lens.
Ray camera_ray(Camera camera, vec2 film, vec2 lens) {
    vec3 through = camera.forward + film.x * camera.right + film.y * camera.up;
    vec3 origin = camera.position;
    if (FX_LENS) {
        vec2 disk = camera.lens_radius * warp_disk(lens);
        vec3 shift = disk.x * normalize(camera.right) + disk.y * normalize(camera.up);
        origin += shift;
        through -= shift / max(camera.focus_distance, 1e-20); // a lens of radius 0 changes no bit
    }
    vec3 direction = normalize(through);
    return Ray(origin + camera.near * direction, direction);
}
