// What the filters read of a pixel's light. Needs `light` (of PixelLight).
PixelLight load_light(int pixel) {
    vec2 a = texelFetch(light, 3 * pixel).xy, b = texelFetch(light, 3 * pixel + 1).xy, c = texelFetch(light, 3 * pixel + 2).xy;
    return PixelLight(vec3(a, b.x), vec3(b.y, c));
}
