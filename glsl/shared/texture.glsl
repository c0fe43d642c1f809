// Bilinear lookups of textures, which share one texel buffer since lavapipe has no descriptor indexing; a GPU's texture units go
// unused. There are no mip levels: a pixel's samples average a texture without the bias of a blur, and levels would cost a third
// more memory.

vec3 linear_from_srgb(vec3 c) {
    return mix(c / 12.92, pow((c + 0.055) / 1.055, vec3(2.4)), greaterThan(c, vec3(0.04045)));
}

vec4 texture_texel(Texture image, ivec2 at, bool colour) {
    ivec2 edge = ivec2(image.width, image.height);
    // Coordinates lie at most one texel outside the image, so that adding or subtracting one period wraps them.
    at = (image.flags & TEXTURE_CLAMP) != 0u ? clamp(at, ivec2(0), edge - 1) : at + mix(ivec2(0), edge, lessThan(at, ivec2(0)));
    at = mix(at, at - edge, greaterThanEqual(at, edge));
    vec4 c = unpackUnorm4x8(texelFetch(texels, int(image.first) + at.y * edge.x + at.x).x);
    return colour ? vec4(linear_from_srgb(c.rgb), c.a) : c;
}

// `colour` decodes sRGB. The caller knows it from the texture's use, so that masks and heights are compiled without decoding.
vec4 texture_sample(uint index, vec2 uv, bool colour) {
    Texture image = Texture_load(textures, index);
    uv = uv * image.scale + image.offset;
    vec2 wrapped = (image.flags & TEXTURE_CLAMP) != 0u ? clamp(uv, 0.0, 1.0) : fract(uv);
    vec2 at = vec2(wrapped.x, 1.0 - wrapped.y) * vec2(image.width, image.height) - 0.5; // v points up, rows go down
    ivec2 corner = ivec2(floor(at));
    vec2 f = at - vec2(corner);
    vec4 top = mix(texture_texel(image, corner, colour), texture_texel(image, corner + ivec2(1, 0), colour), f.x);
    vec4 low = mix(texture_texel(image, corner + ivec2(0, 1), colour),
                   texture_texel(image, corner + ivec2(1, 1), colour), f.x);
    return mix(top, low, f.y);
}

// Opacity of a surface at a point of a triangle: the share of rays that it stops.
float surface_opacity(uint material, uint triangle, vec2 barycentric) {
    if ((Material_flags(materials, material) & MATERIAL_MASKED) == 0u) return 1.0;
    float opacity = Material_opacity(materials, material);
    uint image = Material_opacity_texture(materials, material);
    return image == NONE ? opacity : opacity * texture_sample(image, texture_coordinates(triangle, barycentric), false).r;
}

// Whether a partly transparent surface stops a ray. A ray passes with the probability 1 - opacity, decided by a hash, so that the
// light that passes is right on average, and a cut-out mask (0 or 1) is exact.
bool mask_blocks(uint triangle, uint instance, vec2 barycentric, uint seed) {
    float opacity = surface_opacity(material_of(triangle, instance), triangle, barycentric);
    // Two copies of a triangle on one ray decide independently.
    uint surface = triangle * 0x9e3779b9u ^ instance * 0x85ebca6bu;
    return opacity > unit_interval(pcg(seed ^ surface));
}
