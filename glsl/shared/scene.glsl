// The scene's arrays as texel buffers, and typed access to them. Bound alike by every kernel that traces.
// Records that mix floats and words are fetched as words: a float fetch may flush small integers, denormals, to 0.
layout(binding = 0) uniform usamplerBuffer nodes; // of BvhNode
layout(binding = 1) uniform usamplerBuffer triangles; // of Triangle
layout(binding = 2) uniform usamplerBuffer shading; // of Shading
layout(binding = 3) uniform usamplerBuffer instances; // of Instance
layout(binding = 4) uniform usamplerBuffer materials; // of Material
layout(binding = 5) uniform usamplerBuffer textures; // of Texture
layout(binding = 6) uniform usamplerBuffer texels; // of uint
layout(binding = 7) uniform usamplerBuffer lights; // of Light
layout(binding = 8) uniform usamplerBuffer light_table; // of AliasEntry
layout(binding = 9) uniform samplerBuffer environment; // of vec4
layout(binding = 10) uniform usamplerBuffer environment_table; // of AliasEntry

const uint MATERIAL_TEXELS = 8u;

uvec4 material_texel(uint material, uint i) { return texelFetch(materials, int(MATERIAL_TEXELS * material + i)); }

// Three rows from `first_row` (0 world_from_object, 3 object_from_world) as a matrix for column vectors.
mat4x3 instance_matrix(uint instance, int first_row) {
    int at = int(7u * instance) + first_row;
    return transpose(mat3x4(uintBitsToFloat(texelFetch(instances, at)), uintBitsToFloat(texelFetch(instances, at + 1)),
                            uintBitsToFloat(texelFetch(instances, at + 2))));
}

// (root, material, object, mirrored)
uvec4 instance_words(uint instance) { return texelFetch(instances, int(7u * instance + 6u)); }

uint instance_root(uint instance) { return instance_words(instance).x; }

vec3 triangle_vertex(uint triangle, int i) {
    return uintBitsToFloat(texelFetch(triangles, int(3u * triangle) + i).xyz);
}

uint triangle_object(uint triangle) { return texelFetch(triangles, int(3u * triangle + 2u)).w; }

uint material_of(uint triangle, uint instance) {
    uint material = texelFetch(triangles, int(3u * triangle + 1u)).w;
    if (FX_INSTANCES && instance != NONE) {
        uint override = instance_words(instance).y;
        material = override == NONE ? material : override;
    }
    return material;
}

#include "shared/sphere.glsl"

vec2 texture_coordinates(uint triangle, vec2 barycentric) {
    if (FX_SPHERES && is_sphere(triangle)) return sphere_coordinates(sphere_of(triangle), octahedral_vector(barycentric));
    int at = int(3u * triangle);
    vec4 a = uintBitsToFloat(texelFetch(shading, at));
    vec4 b = uintBitsToFloat(texelFetch(shading, at + 1));
    vec4 c = uintBitsToFloat(texelFetch(shading, at + 2));
    vec2 uv0 = vec2(a.w, b.x), uv1 = b.yz, uv2 = vec2(b.w, c.x);
    return uv0 + barycentric.x * (uv1 - uv0) + barycentric.y * (uv2 - uv0);
}
