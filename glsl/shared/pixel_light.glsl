// What the filters read of a pixel's light. Needs `light` (of PixelLight).
PixelLight load_light(int pixel) {
    uvec4 a = texelFetch(light, 2 * pixel), b = texelFetch(light, 2 * pixel + 1);
    return PixelLight(uintBitsToFloat(a.xyz), uintBitsToFloat(a.w), uintBitsToFloat(b.xyz), b.w);
}
