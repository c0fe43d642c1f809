// Bilinear lookups of textures, which share one texel buffer since lavapipe has no descriptor indexing; a GPU's texture units go
// unused. There are no mip levels: a pixel's samples average a texture without the bias of a blur, and levels would cost a third
// more memory.

#include "shared/texel_word.glsl"

vec3 linear_from_srgb(vec3 c) {
    return mix(c / 12.92, pow((c + 0.055) / 1.055, vec3(2.4)), greaterThan(c, vec3(0.04045)));
}

// Whether what lies beyond an edge of the picture, along each axis, looks like its border: a mirrored picture goes on with it.
bvec2 texture_keeps_border(Texture image) {
    if (!FX_TEXTURE_MODES) return bvec2((image.flags & TEXTURE_CLAMP) != 0u);
    const uvec2 MODES = uvec2(TEXTURE_CLAMP | TEXTURE_CLAMP_U | TEXTURE_MIRROR_U, TEXTURE_CLAMP | TEXTURE_CLAMP_V | TEXTURE_MIRROR_V);
    return notEqual(uvec2(image.flags) & MODES, uvec2(0u));
}

vec4 texture_texel(Texture image, ivec2 at, bool colour) {
    ivec2 edge = ivec2(image.width, image.height);
    // Coordinates lie at most one texel outside the image, so that adding or subtracting one period wraps them.
    at = mix(at + mix(ivec2(0), edge, lessThan(at, ivec2(0))), clamp(at, ivec2(0), edge - 1), texture_keeps_border(image));
    at = mix(at, at - edge, greaterThanEqual(at, edge));
    uint word = texel_word(image.first + uint(at.y * edge.x + at.x));
    if (FX_HDR_TEXTURES && (image.flags & TEXTURE_FLOAT) != 0u) return vec4(uintBitsToFloat(word));
    if (FX_HDR_TEXTURES && (image.flags & TEXTURE_RGB9E5) != 0u) {
        float unit = uintBitsToFloat(((word >> 27) + 103u) << 23); // 2^(exponent - 24)
        return vec4(vec3(uvec3(word, word >> 9, word >> 18) & 511u) * unit, 1.0);
    }
    vec4 c = unpackUnorm4x8(word);
    return colour ? vec4(linear_from_srgb(c.rgb), c.a) : c;
}

// `colour` decodes sRGB. The caller knows it from the texture's use, so that masks and heights are compiled without decoding.
vec4 texture_sample(uint index, vec2 uv, bool colour) {
    Texture image = Texture_load(textures, index);
    vec2 turned = uv.yx * image.shear;
    uv = uv * image.scale + image.offset;
    if (FX_TEXTURE_MODES && (image.flags & TEXTURE_SHEARED) != 0u) uv += turned;
    vec2 wrapped = mix(fract(uv), clamp(uv, 0.0, 1.0), texture_keeps_border(image));
    if (FX_TEXTURE_MODES) { // there and back, in turns of two pictures
        bvec2 mirrors = notEqual(uvec2(image.flags) & uvec2(TEXTURE_MIRROR_U, TEXTURE_MIRROR_V), uvec2(0u));
        wrapped = mix(wrapped, 1.0 - abs(2.0 * fract(0.5 * uv) - 1.0), mirrors);
    }
    vec2 at = vec2(wrapped.x, 1.0 - wrapped.y) * vec2(image.width, image.height) - 0.5; // v points up, rows go down
    if (FX_TEXTURE_MODES && (image.flags & TEXTURE_NEAREST) != 0u) at = floor(at + 0.5);
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
    if (image != NONE) opacity *= texture_sample(image, texture_coordinates(image, triangle, barycentric), false).r;
    if (FX_VERTEX_COLORS) opacity *= vertex_color(Shading_load(shading, triangle), barycentric).a;
    if (FX_CUTOFF) {
        float cutoff = Material_alpha_cutoff(materials, material);
        opacity = cutoff > 0.0 ? float(opacity >= cutoff) : opacity;
    }
    return opacity;
}

// Whether a partly transparent surface stops a ray. A ray passes with the probability 1 - opacity, decided by a hash, so that the
// light that passes is right on average, and a cut-out mask (0 or 1) is exact.
bool mask_blocks(uint triangle, uint instance, vec2 barycentric, uint seed) {
    float opacity = surface_opacity(material_of(triangle, instance), triangle, barycentric);
    // Two copies of a triangle on one ray decide independently.
    uint surface = triangle * 0x9e3779b9u ^ instance * 0x85ebca6bu;
    return opacity > unit_interval(pcg(seed ^ surface));
}
