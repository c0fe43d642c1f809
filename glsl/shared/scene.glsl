// The scene's arrays as texel buffers, which every kernel that traces binds, and typed access to them. Records that mix floats
// and integers are fetched as integers: a float fetch may flush denormals, which small integers are, to 0.
layout(binding = 0) uniform usamplerBuffer nodes; // of BvhNode
layout(binding = 1) uniform usamplerBuffer triangles; // of Triangle
layout(binding = 2) uniform usamplerBuffer shading; // of Shading
layout(binding = 3) uniform usamplerBuffer instances; // of Instance
layout(binding = 4) uniform usamplerBuffer materials; // of Material
layout(binding = 5) uniform usamplerBuffer textures; // of Texture
layout(binding = 6) uniform usamplerBuffer texels; // of uint

// Matrices that multiply column vectors.
mat4x3 world_from_object(uint instance) {
    return transpose(mat3x4(Instance_world0(instances, instance), Instance_world1(instances, instance),
                            Instance_world2(instances, instance)));
}

mat4x3 object_from_world(uint instance) {
    return transpose(mat3x4(Instance_object0(instances, instance), Instance_object1(instances, instance),
                            Instance_object2(instances, instance)));
}

uint material_of(uint triangle, uint instance) {
    uint material = Triangle_material(triangles, triangle);
    if (FX_INSTANCES && instance != NONE) {
        uint override = Instance_material(instances, instance);
        material = override == NONE ? material : override;
    }
    return material;
}

#include "shared/sphere.glsl"
#include "shared/attributes.glsl"

// Coordinates at which a point of a triangle reads pictures: the first set, and the second one, which is the first where there is none.
vec4 texture_coordinates(uint triangle, vec2 barycentric) {
    if (FX_SPHERES && is_sphere(triangle)) return sphere_coordinates(sphere_of(triangle), octahedral_vector(barycentric)).xyxy;
    Shading s = Shading_load(shading, triangle);
    vec2 first = s.uv0 + barycentric.x * (s.uv1 - s.uv0) + barycentric.y * (s.uv2 - s.uv0);
    if (!FX_SECOND_UV) return first.xyxy;
    take_second_coordinates(s);
    return vec4(first, s.uv0 + barycentric.x * (s.uv1 - s.uv0) + barycentric.y * (s.uv2 - s.uv0));
}

// Those of the picture `image`.
vec2 uv_of(vec4 coordinates, uint image) {
    return FX_SECOND_UV && (Texture_flags(textures, image) & TEXTURE_SECOND_UV) != 0u ? coordinates.zw : coordinates.xy;
}
