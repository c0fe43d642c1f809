// Mean radiance of the 3x3 pixels of the last frame around one, those of the border repeated: that of a single pixel would let noise
// decide, and dark samples would be kept more often. Needs `history`.
vec3 light_around(uint pixel, uvec2 film) {
    ivec2 size = ivec2(film), at = ivec2(pixel % film.x, pixel / film.x);
    vec3 sum = vec3(0.0);
    for (int k = 0; k < 9; k++) {
        ivec2 q = clamp(at + ivec2(k % 3 - 1, k / 3 - 1), ivec2(0), size - 1);
        sum += History_mean(history, uint(q.y * size.x + q.x));
    }
    return sum / 9.0;
}
