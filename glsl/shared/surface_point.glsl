// Points of surfaces as they are kept from frame to frame.
#include "shared/frame.glsl"
#include "shared/surface.glsl"

// Lambertian reflection alone is the same in every direction.
const bool DEPENDS_ON_VIEW = !ONE_KIND || !FX_DIFFUSE;

Surface surface_of(uint triangle, uint instance, vec2 weights) {
    return surface_at(Hit(0.0, triangle, instance, weights.x, weights.y));
}

Surface surface_of(SurfacePoint p) { return surface_of(p.triangle, p.instance, p.weights); }

// Film coordinates in pixels of a point in the scene, and in z its distance along the view direction, which is not above 0 for a
// point that is not in front of the camera. A camera whose axes lie in one plane gives no numbers.
vec3 film_from_point(Camera camera, vec3 point, uvec2 size) {
    vec3 off = point - camera.position, across = cross(camera.right, camera.up);
    float det = dot(camera.forward, across), along = dot(off, across) / det;
    vec2 film = vec2(dot(off, cross(camera.up, camera.forward)), dot(off, cross(camera.forward, camera.right))) / (det * along);
    return vec3((film * vec2(0.5, -0.5) + 0.5) * vec2(size), along);
}
