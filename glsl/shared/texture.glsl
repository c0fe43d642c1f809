// Bilinear lookups of textures, which share one texel buffer since lavapipe has no descriptor indexing; a GPU's texture units go
// unused. There are no mip levels: a pixel's samples average a texture without the bias of a blur, and levels would cost a third
// more memory.
#include "shared/largest_channel.glsl"
#include "shared/sampler.glsl"
#include "shared/scene.glsl"
#include "shared/segment.glsl"
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
    // Coordinates lie at most one texel outside the image, so that adding or subtracting one period wraps them. What no number has become
    // may lie anywhere.
    ivec2 wrapped = at + mix(ivec2(0), edge, lessThan(at, ivec2(0))) - mix(ivec2(0), edge, greaterThanEqual(at, edge));
    at = clamp(mix(wrapped, at, texture_keeps_border(image)), ivec2(0), edge - 1);
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
    // A loop, which drivers unroll: kernels would hold four times as much for each picture that they look up.
    vec4 a = vec4(0.0), b = a, c = a, d = a;
    for (int i = 0; i < 4; i++) {
        a = b;
        b = c;
        c = d;
        d = texture_texel(image, corner + ivec2(i & 1, i >> 1), colour);
    }
    return mix(mix(a, b, f.x), mix(c, d, f.x), f.y);
}

// Opacity of a surface at a point of a triangle: the share of rays that it stops.
float surface_opacity(uint material, uint triangle, vec2 barycentric) {
    if ((Material_flags(materials, material) & MATERIAL_MASKED) == 0u) return 1.0;
    float opacity = Material_opacity(materials, material);
    uint image = Material_opacity_texture(materials, material);
    if (image != NONE) opacity *= texture_sample(image, uv_of(texture_coordinates(triangle, barycentric), image), false).r;
    if (FX_VERTEX_COLORS) opacity *= vertex_color(Shading_load(shading, triangle), barycentric).a;
    if (FX_CUTOFF) {
        float cutoff = Material_alpha_cutoff(materials, material);
        opacity = cutoff > 0.0 ? float(opacity >= cutoff) : opacity;
    }
    return opacity;
}

// What a picture makes of `constant` at a point with these `coordinates`.
vec3 textured_at(vec3 constant, uint image, vec4 coordinates, bool color) {
    if (!FX_TEXTURES || image == NONE) return constant;
    return constant * texture_sample(image, uv_of(coordinates, image), color).rgb;
}

// Whether a thin wall is smooth at a point. `share` is what of the light it lets straight through there, as metallic_sample does: nothing
// else brings the light of a source without extent behind it. `direction` is that of the ray in the space of the triangle; the normal is
// that of the triangle itself.
bool clear_wall_passes(uint material, uint triangle, uint instance, vec2 barycentric, vec3 direction, out vec3 share) {
    Material m = Material_load(materials, material);
    Triangle t = Triangle_load(triangles, triangle);
    vec3 n = cross(t.v1 - t.v0, t.v2 - t.v0);
    if (FX_SPHERES && is_sphere(triangle)) n = octahedral_vector(barycentric);
    float along = abs(dot(n, direction)); // the same in the world, which the lengths are not
    if (FX_INSTANCES && instance != NONE) {
        n *= mat3(object_from_world(instance)); // row vector times matrix
        direction = mat3(world_from_object(instance)) * direction;
    }
    float c = along * inversesqrt(max(dot(n, n) * dot(direction, direction), 1e-37));
    float grazing = 1.0 - min(c, 1.0), squared = grazing * grazing;
    vec4 at = FX_TEXTURES ? texture_coordinates(triangle, barycentric) : vec4(0.0);
    vec3 base = textured_at(m.base_color, m.base_texture, at, true);
    if (FX_VERTEX_COLORS) base *= vertex_color(Shading_load(shading, triangle), barycentric).rgb;
    vec3 factors = textured_at(vec3(1.0), m.roughness_texture, at, false); // of roughness in g, of metal in b
    float through = textured_at(vec3(m.transmission_factor), m.transmission_texture, at, false).r;
    float f90 = textured_at(vec3(m.specular_factor), m.specular_factor_texture, at, false).r;
    vec3 specular = textured_at(m.specular, m.specular_texture, at, true);
    float f0 = min(largest_channel(specular), 1.0) * f90;
    share = base * (through * (1.0 - m.metallic * factors.b) * (1.0 - mix(f0, f90, squared * squared * grazing)));
    return m.alpha * factors.g * factors.g < SMOOTH_ALPHA;
}

// The number in [0, 1) that a surface's opacity is compared with: over the samples of a pixel one dimension of the sampler for each
// surface, so that of the first 2^k samples as many pass as should, to one. Two copies of a triangle on one ray decide independently.
float mask_number(uint triangle, uint instance, uint seed) {
    uint surface = triangle * 0x9e3779b9u ^ instance * 0x85ebca6bu;
    if ((seed & BY_CHANCE) == 0u) return 0.5;
    return unit_interval(owen_reversed(seed & MASK_INDEX, pcg(surface ^ (seed & MASK_HASH))));
}

// Whether a partly transparent surface stops a ray. A ray passes with the probability 1 - opacity, so that the light that passes is
// right on average, and a cut-out mask (0 or 1) is exact. Clear walls, and materials that let a share of light
// pass everywhere, dim the light of shadow rays to lights without extent, without noise, and must be asked once only.
bool mask_blocks(uint triangle, uint instance, vec2 barycentric, vec3 direction, uint seed) {
    uint material = material_of(triangle, instance);
    float opacity = surface_opacity(material, triangle, barycentric);
    if (FX_CLEAR_WALLS && (seed & PASSES_WALLS) != 0u) {
        vec3 share;
        bool clear = (Material_flags(materials, material) & MATERIAL_CLEAR_WALL) != 0u &&
                     clear_wall_passes(material, triangle, instance, barycentric, direction, share);
        if (!clear) share = vec3(0.0);
        if (clear || Material_opacity(materials, material) < 1.0) return !pass_wall(1.0 - opacity * (1.0 - share));
    }
    return opacity > mask_number(triangle, instance, seed);
}
