// What some meshes have at their vertices beyond normals and texture coordinates: words among the texels, in the order colours, second
// coordinates, tangents. Needs scene.glsl's bindings.
#include "shared/octahedral.glsl"
#include "shared/texel_word.glsl"

uint attribute_word(Shading s, uint k) {
    return texel_word(s.first + k);
}

// Index of the first word of the second coordinates, and of the tangents.
uint second_coordinates_at(Shading s) { return (s.attributes & ATTRIBUTE_COLORS) != 0u ? 6u : 0u; }
uint tangents_at(Shading s) { return second_coordinates_at(s) + ((s.attributes & ATTRIBUTE_SECOND_UV) != 0u ? 6u : 0u); }

vec4 vertex_color_of(Shading s, uint corner) {
    uint at = 2u * corner;
    return vec4(unpackUnorm2x16(attribute_word(s, at)), unpackUnorm2x16(attribute_word(s, at + 1u)));
}

// Linear colour and opacity at a point; white where the mesh has none.
vec4 vertex_color(Shading s, vec2 barycentric) {
    if ((s.attributes & ATTRIBUTE_COLORS) == 0u) return vec4(1.0);
    vec4 c0 = vertex_color_of(s, 0u);
    return c0 + barycentric.x * (vertex_color_of(s, 1u) - c0) + barycentric.y * (vertex_color_of(s, 2u) - c0);
}

// The second set of texture coordinates at the corners in place of the first, where there is one.
void take_second_coordinates(inout Shading s) {
    if ((s.attributes & ATTRIBUTE_SECOND_UV) == 0u) return;
    uint at = second_coordinates_at(s);
    s.uv0 = uintBitsToFloat(uvec2(attribute_word(s, at), attribute_word(s, at + 1u)));
    s.uv1 = uintBitsToFloat(uvec2(attribute_word(s, at + 2u), attribute_word(s, at + 3u)));
    s.uv2 = uintBitsToFloat(uvec2(attribute_word(s, at + 4u), attribute_word(s, at + 5u)));
}

// Tangent at a point in the space of the mesh, not normalised, and the sign of the bitangent; all 0 where the mesh has none.
vec4 vertex_tangent(Shading s, vec2 barycentric) {
    if ((s.attributes & ATTRIBUTE_TANGENTS) == 0u) return vec4(0.0);
    uint at = tangents_at(s);
    vec3 t0 = octahedral_decode(attribute_word(s, at));
    vec3 t = t0 + barycentric.x * (octahedral_decode(attribute_word(s, at + 1u)) - t0) +
             barycentric.y * (octahedral_decode(attribute_word(s, at + 2u)) - t0);
    return vec4(t, (s.attributes & ATTRIBUTE_FLIPPED) != 0u ? -1.0 : 1.0);
}
