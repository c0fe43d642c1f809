// What the lens of a camera blurs. Needs the effects.
#include "shared/frame.glsl"

// Radii of the circle of confusion, in pixels, up to which the lens shows a point sharp, and from which on it shows it blurred.
const float SHARP_RADIUS = 0.5, BLURRED_RADIUS = 2.0;

// How far the lens blurs what lies at a distance along the view direction, from 0, sharp, to 1.
float lens_blur(float along, uvec2 size) {
    along = clamp(along, 1e-18, 1e18); // what is nowhere lies at infinity
    bool is_parallel = FX_ORTHOGRAPHIC && camera.orthographic != 0u;
    float off = abs(1.0 / max(camera.focus_distance, 1e-20) - 1.0 / along) * (is_parallel ? along : 1.0);
    return smoothstep(SHARP_RADIUS, BLURRED_RADIUS, camera.lens_radius * off / pixel_width(camera, size));
}
