// Textures out of one texel buffer, filtered here: lavapipe has no descriptor indexing. Bilinear within the mip level
// that the ray cone asks for (Akenine-Moller et al., JCGT 2021), none between levels.

vec3 linear_from_srgb(vec3 c) {
    return mix(c / 12.92, pow((c + 0.055) / 1.055, vec3(2.4)), greaterThan(c, vec3(0.04045)));
}

vec4 texture_texel(uvec4 image, uint first, uvec2 size, ivec2 at) {
    ivec2 edge = ivec2(size);
    // Coordinates come in as floor(uv * size) with uv already wrapped to one period, so one step over is enough.
    at = (image.w & TEXTURE_CLAMP) != 0u ? clamp(at, ivec2(0), edge - 1) : at + mix(ivec2(0), edge, lessThan(at, ivec2(0)));
    at = mix(at, at - edge, greaterThanEqual(at, edge));
    vec4 c = unpackUnorm4x8(texelFetch(texels, int(first) + at.y * edge.x + at.x).x);
    return (image.w & TEXTURE_SRGB) != 0u ? vec4(linear_from_srgb(c.rgb), c.a) : c;
}

// `lod` in levels of this texture, 0 = full resolution.
vec4 texture_sample(uint index, vec2 uv, float lod) {
    uvec4 image = texelFetch(textures, int(index));
    uint levels = (image.w >> 8) & 0xffu;
    uint level = uint(clamp(lod + 0.5, 0.0, float(levels - 1u)));
    uint first = image.x;
    uvec2 size = image.yz;
    // No vector is carried around the loop: Mesa 22.3's lavapipe mixes up lanes that leave such a loop at different times.
    for (uint l = 0u; l < level; l++) {
        uvec2 skipped = max(size >> l, uvec2(1u));
        first += skipped.x * skipped.y;
    }
    size = max(size >> level, uvec2(1u));
    vec2 wrapped = (image.w & TEXTURE_CLAMP) != 0u ? clamp(uv, 0.0, 1.0) : fract(uv);
    vec2 at = vec2(wrapped.x, 1.0 - wrapped.y) * vec2(size) - 0.5; // v points up, rows go down
    ivec2 corner = ivec2(floor(at));
    vec2 f = at - vec2(corner);
    vec4 top = mix(texture_texel(image, first, size, corner), texture_texel(image, first, size, corner + ivec2(1, 0)), f.x);
    vec4 low = mix(texture_texel(image, first, size, corner + ivec2(0, 1)),
                   texture_texel(image, first, size, corner + ivec2(1, 1)), f.x);
    return mix(top, low, f.y);
}

float texture_size_log2(uint index) {
    uvec4 image = texelFetch(textures, int(index));
    return 0.5 * log2(float(image.y) * float(image.z));
}

// Partly transparent surfaces let a ray pass with the probability 1 - opacity, decided by a hash, so the light that
// gets through is right on average and a cut-out mask (0 or 1) is exact.
bool mask_blocks(uint triangle, uint instance, vec2 barycentric, uint seed) {
    uint material = material_of(triangle, instance);
    uvec4 k = material_texel(material, 3u);
    if ((k.w & MATERIAL_MASKED) == 0u) return true;
    float opacity = uintBitsToFloat(material_texel(material, 2u).w);
    uint image = material_texel(material, 6u).y;
    if (image != NONE) {
        opacity *= texture_sample(image, texture_coordinates(triangle, barycentric), 0.0).r;
    }
    // Two copies of a triangle on one ray decide independently.
    uint surface = triangle * 0x9e3779b9u ^ instance * 0x85ebca6bu;
    return opacity > float(pcg(seed ^ surface) >> 8) * 5.9604644775390625e-8;
}
