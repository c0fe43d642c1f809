// Cells of the image for which it is told how much of the light does not follow albedo. Needs noisy.glsl and albedo.glsl.
const int GLOSS_CELL = 16; // pixels along a side
// Pixels show one surface where their normals have at least this cosine, and one lies at most so far off the other's plane, as a share of
// its depth.
const float ONE_SURFACE_COSINE = 0.9, ONE_PLANE = 0.02;

ivec2 gloss_cells_of(uvec2 size) { return (ivec2(size) + GLOSS_CELL - 1) / GLOSS_CELL; }

// The pixel that a cell stands around.
int middle_of(ivec2 cell, uvec2 size) {
    ivec2 at = min(GLOSS_CELL * cell + GLOSS_CELL / 2, ivec2(size) - 1);
    return at.y * int(size.x) + at.x;
}

// Whether pixel `q` shows the surface that `i` shows.
bool one_surface(int q, int i) {
    vec3 normal = Guide_normal(guide, i), off = Guide_position(guide, q) - Guide_position(guide, i);
    return dot(normal, Guide_normal(guide, q)) > ONE_SURFACE_COSINE && abs(dot(normal, off)) < ONE_PLANE * Guide_depth(guide, i);
}

// What lies farther off the plane, as a share of the distance, is something else behind or before it.
const float STEEPEST = 0.3;

// Whether nothing that lies before or behind comes between the surfaces of pixels `q` and `i`.
bool connected(int q, int i) {
    vec3 off = Guide_position(guide, q) - Guide_position(guide, i);
    return one_surface(q, i) && abs(dot(Guide_normal(guide, i), off)) <= STEEPEST * length(off);
}

// Albedos of one material are at most so many times each other; what differs more is another one, or a picture on it, and light that is
// divided by the mean of both would have a colour of its own.
const float MOST_CONTRAST = 4.0;

bool one_material(vec3 a, vec3 b) {
    a = divisor(a);
    b = divisor(b);
    return all(lessThanEqual(a, MOST_CONTRAST * b)) && all(lessThanEqual(b, MOST_CONTRAST * a));
}

// Whether the light of a pixel tells of the albedo of what it shows.
bool tells_albedo(int i) {
    bool known = count_at(i) > 0.0 && finite(colour_at(i)) && finite(PixelLight_direct(light, i));
    return known && !marked(i, SOME_BARE) && reflects(albedo_at(i));
}
