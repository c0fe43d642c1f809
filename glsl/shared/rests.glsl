// Whether a pixel goes on to show what it has shown while other things move: before a camera at rest. Needs held.glsl and whole_pixel.glsl.

// Points that are seen this near to where they were rest, in widths of a pixel: for rounding.
const float AT_REST = 0.03125;

// Whether the pixel's point is seen through its centre, where points begin, from the side that its samples are of, and still is what is
// seen there. What the sky and specular surfaces show is looked at by no probe: the sky rests as long as its light does, these never.
bool point_rests(uint pixel) {
    uint triangle = History_triangle(history, pixel);
    if (triangle == NONE) return push.sky == 0u && Guide_object(guide, pixel) == NONE;
    Surface s = surface_of(triangle, History_instance(history, pixel), History_weights(history, pixel));
    Carried c = carried_of(History_resting(history, pixel));
    bool same_side = c.count > 0u && c.back == (dot(s.geometric, camera.position - s.position) < 0.0);
    vec3 film = film_from_point(camera, s.position, push.size);
    vec2 off = abs(film.xy - vec2(pixel % push.size.x, pixel / push.size.x) - 0.5);
    return same_side && film.z > 0.0 && max(off.x, off.y) <= AT_REST && shows(pixel, s);
}

// The samples that a pixel keeps as they are, which is at an edge in the new frame or not: none unless its point rests, and at an edge
// those around it. Of what they show of textures and shadows within the pixel nothing is lost then. Its word of what it hands on is 0
// where nothing is, not even a reason: what is remembered is of no use then.
Carried resting(uint pixel, uint word, bool edge) {
    Carried c = carried_of(History_resting(history, pixel));
    int k = edge ? 0 : 4, end = edge ? 9 : 5; // the fifth of nine is the pixel
    bool rests = word != 0u && previous == camera && c.count > 0u && c.edge == edge;
    while (rests && k < end) rests = point_rests(neighbour(pixel, k++));
    if (!rests) c.count = 0u;
    return c;
}
