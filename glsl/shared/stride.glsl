// Whether a pixel is one of those, `stride` apart along both axes, whose light is traced whole. Twin: Holds::has_indirect.
bool on_stride(uint pixel, uint width, uint stride) {
    return all(equal(uvec2(pixel % width, pixel / width) % stride, uvec2(0u)));
}
