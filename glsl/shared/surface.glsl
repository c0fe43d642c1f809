// From a hit to what shading needs: position, normals, a resolved BSDF, emission.
#include "shared/octahedral.glsl"

struct Surface {
    vec3 position;  // world, interpolated from the vertices: more exact than origin + t * direction
    vec3 geometric; // unit, by the winding of the triangle
    vec3 normal;    // unit shading normal, on the side that the vertex normals point to
    uint material;
    uint flags;     // of the material
    uint object;
    vec2 uv;
};

// Height map (Blinn 1978) or tangent-space normal map. `e1`, `e2` are edges, `d1`, `d2` their extents in uv.
vec3 perturbed_normal(Surface s, vec3 e1, vec3 e2, vec2 d1, vec2 d2) {
    uint image = material_texel(s.material, 6u).z;
    float det = d1.x * d2.y - d2.x * d1.y;
    if (image == NONE || det == 0.0) return s.normal;
    vec3 dpdu = (d2.y * e1 - d1.y * e2) / det;
    vec3 dpdv = (d1.x * e2 - d2.x * e1) / det;
    bool mapped = FX_NORMAL_MAPS && (!FX_BUMP_MAPS || (s.flags & MATERIAL_NORMAL_MAP) != 0u);
    uvec4 words = texelFetch(textures, int(2u * image));
    vec2 scale = uintBitsToFloat(texelFetch(textures, int(2u * image + 1u)).xy);
    vec2 texel = 1.0 / (vec2(words.yz) * max(abs(scale), 1e-6));
    // The normal, or heights here, one texel along u and one along v.
    vec3 value;
    float here, along_u = 0.0, along_v = 0.0;
    int k = 0;
    do {
        here = along_u;
        along_u = along_v;
        value = texture_sample(image, s.uv + vec2(k == 1 ? texel.x : 0.0, k == 2 ? texel.y : 0.0), false).xyz;
        along_v = value.r;
    } while (FX_BUMP_MAPS && !mapped && ++k < 3);
    vec3 n;
    if (mapped) {
        vec3 m = 2.0 * value - 1.0;
        vec3 t = dpdu - s.normal * dot(s.normal, dpdu);
        t *= inversesqrt(max(dot(t, t), 1e-30));
        vec3 b = cross(s.normal, t);
        n = m.x * t + m.y * (dot(b, dpdv) < 0.0 ? -b : b) + m.z * s.normal;
    } else {
        float height = uintBitsToFloat(material_texel(s.material, 4u).w);
        vec3 pu = dpdu + s.normal * (height * ((along_u - here) / texel.x) - dot(s.normal, dpdu));
        vec3 pv = dpdv + s.normal * (height * ((along_v - here) / texel.y) - dot(s.normal, dpdv));
        n = cross(pu, pv);
        n = dot(n, s.normal) < 0.0 ? -n : n;
    }
    float len = dot(n, n);
    return len > 1e-30 && len < 1e38 ? n * inversesqrt(len) : s.normal; // not where uv spans no or all of space
}

Surface surface_at(Hit hit) {
    Surface s;
    vec3 p0 = triangle_vertex(hit.triangle, 0);
    vec3 e1 = triangle_vertex(hit.triangle, 1) - p0;
    vec3 e2 = triangle_vertex(hit.triangle, 2) - p0;
    s.object = triangle_object(hit.triangle);
    s.material = material_of(hit.triangle, hit.instance);
    mat3 normals_from_object = mat3(1.0);
    bool mirrored = false;
    if (FX_INSTANCES && hit.instance != NONE) {
        mat4x3 world = instance_matrix(hit.instance, 0);
        normals_from_object = transpose(mat3(instance_matrix(hit.instance, 3)));
        uvec4 words = instance_words(hit.instance);
        p0 = world * vec4(p0, 1.0);
        e1 = mat3(world) * e1;
        e2 = mat3(world) * e2;
        s.object += words.z;
        mirrored = words.w != 0u;
    }
    s.flags = material_texel(s.material, 3u).w;
    s.position = p0 + hit.b1 * e1 + hit.b2 * e2;
    vec3 scaled = mirrored ? cross(e2, e1) : cross(e1, e2);
    float doubled_area = max(length(scaled), 1e-30); // a needle that rounds to no area scatters nothing
    s.geometric = scaled / doubled_area;
    s.normal = s.geometric;
    s.uv = vec2(0.0);
    if (!(FX_SMOOTH_NORMALS || FX_TEXTURES || FX_BUMP_MAPS || FX_NORMAL_MAPS)) return s;

    int at = int(3u * hit.triangle);
    uvec4 w0 = texelFetch(shading, at), w1 = texelFetch(shading, at + 1);
    if (FX_SMOOTH_NORMALS && (w0.x & w0.y & w0.z) != 0xffffffffu) {
        vec3 n = mix(octahedral_decode(w0.x), octahedral_decode(w0.y), hit.b1) +
                 hit.b2 * (octahedral_decode(w0.z) - octahedral_decode(w0.x));
        n = normals_from_object * n;
        float len = dot(n, n);
        s.normal = len > 1e-20 ? n * inversesqrt(len) : s.geometric;
    }
    if (FX_TEXTURES || FX_BUMP_MAPS || FX_NORMAL_MAPS) {
        uint w2 = texelFetch(shading, at + 2).x;
        vec2 uv0 = uintBitsToFloat(uvec2(w0.w, w1.x));
        vec2 d1 = uintBitsToFloat(w1.yz) - uv0;
        vec2 d2 = uintBitsToFloat(uvec2(w1.w, w2)) - uv0;
        s.uv = uv0 + hit.b1 * d1 + hit.b2 * d2;
        if (FX_BUMP_MAPS || FX_NORMAL_MAPS) s.normal = perturbed_normal(s, e1, e2, d1, d2);
    }
    return s;
}

vec3 textured(vec3 constant, uint image, Surface s) {
    if (!FX_TEXTURES || image == NONE) return constant;
    return constant * texture_sample(image, s.uv, true).rgb;
}

// Radiance that the surface emits from its front side.
vec3 surface_emission(Surface s) {
    vec3 emission = uintBitsToFloat(material_texel(s.material, 1u).xyz);
    if (!FX_TEXTURES) return emission;
    uint image = material_texel(s.material, 7u).x;
    return image == NONE ? emission : emission * texture_sample(image, s.uv, true).rgb;
}

Bsdf surface_bsdf(Surface s) {
    Bsdf b;
    uvec4 m0 = material_texel(s.material, 0u), m5 = uvec4(0u, 0u, 0u, NONE), m6 = uvec4(NONE);
    if (FX_TEXTURES || FX_DIELECTRIC) m5 = material_texel(s.material, 5u);
    if (FX_TEXTURES) m6 = material_texel(s.material, 6u);
    b.kind = material_texel(s.material, 1u).w;
    b.albedo = textured(uintBitsToFloat(m0.xyz), m5.w, s);
    b.transmission = uintBitsToFloat(m5.xyz);
    b.ggx = (s.flags & MATERIAL_GGX) != 0u;
    b.alpha = uintBitsToFloat(m0.w);
    b.eta = vec3(1.0);
    b.k = vec3(0.0);
    b.specular = vec3(0.0);
    b.internal_fresnel = 0.0;
    b.coat_table = 0u;
    b.nonlinear = (s.flags & MATERIAL_NONLINEAR) != 0u;
    if (FX_CONDUCTOR || FX_DIELECTRIC || FX_COATED) {
        b.eta = uintBitsToFloat(material_texel(s.material, 2u).xyz);
        b.k = uintBitsToFloat(material_texel(s.material, 3u).xyz);
        b.specular = textured(uintBitsToFloat(material_texel(s.material, 4u).xyz), m6.x, s);
        if (FX_COATED) {
            uvec4 m7 = material_texel(s.material, 7u);
            b.internal_fresnel = uintBitsToFloat(m7.y);
            b.coat_table = m7.w;
        }
        if (FX_TEXTURES && m6.w != NONE) {
            float r = texture_sample(m6.w, s.uv, false).r; // perceptual: alpha = r^2
            b.alpha *= r * r;
        }
    }
    return b;
}

// Moves a point off its surface so that a ray from it does not meet the surface again.
// Waechter and Binder, Ray Tracing Gems 2019, chapter 6.
vec3 offset_origin(vec3 p, vec3 n) {
    const float ORIGIN = 1.0 / 32.0, FLOAT_SCALE = 1.0 / 65536.0, INT_SCALE = 256.0;
    ivec3 steps = ivec3(INT_SCALE * n);
    vec3 stepped = intBitsToFloat(floatBitsToInt(p) + mix(steps, -steps, lessThan(p, vec3(0.0))));
    return mix(stepped, p + FLOAT_SCALE * n, lessThan(abs(p), vec3(ORIGIN)));
}
