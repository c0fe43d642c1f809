// Normals that maps perturb: those of surfaces and of their clear coats. Needs Surface and uv_of before it.

// Directions along which u and v rise, in world units.
struct Slopes {
    vec3 u;
    vec3 v;
    bool known;
};

// `e1`, `e2` are edges, `d1`, `d2` their extents in uv.
Slopes slopes_of(vec3 e1, vec3 e2, vec2 d1, vec2 d2) {
    float det = d1.x * d2.y - d2.x * d1.y;
    return Slopes((d2.y * e1 - d1.y * e2) / det, (d1.x * e2 - d2.x * e1) / det, det != 0.0);
}

// The same of the coordinates at which a picture is read, but for positive factors.
Slopes slopes_in(Texture image, Slopes s) {
    float side = image.scale.x * image.scale.y < image.shear.x * image.shear.y ? -1.0 : 1.0;
    return Slopes(side * (image.scale.y * s.u - image.shear.y * s.v), side * (image.scale.x * s.v - image.shear.x * s.u), s.known);
}

// A direction of tangent space, around the smooth normal; not normalised.
vec3 from_tangent_space(Surface s, vec3 m, Slopes slopes) {
    bool given = FX_TANGENTS && s.tangent.w != 0.0;
    vec3 n = s.smooth_normal, along = given ? s.tangent.xyz : slopes.u;
    float length_along;
    vec3 t = unit_vector(along - n * dot(n, along), length_along);
    vec3 b = cross(n, t);
    bool flipped = given ? s.tangent.w < 0.0 : dot(b, slopes.v) < 0.0;
    return m.x * t + m.y * (flipped ? -b : b) + m.z * n;
}

// `n` normalised, or the smooth normal where degenerate uv coordinates leave none.
vec3 normal_or_smooth(Surface s, vec3 n) {
    float len;
    n = unit_vector(n, len);
    return len > 0.0 && len < 1e37 ? n : s.smooth_normal;
}

// The smooth normal perturbed by the map of a clear coat.
vec3 perturbed_coat(Surface s, Slopes slopes) {
    uint image = Material_clearcoat_normal_texture(materials, s.material);
    if (image == NONE || !(slopes.known || (FX_TANGENTS && s.tangent.w != 0.0))) return s.smooth_normal;
    vec3 m = 2.0 * texture_sample(image, uv_of(s, image), false).xyz - 1.0;
    m.xy *= Material_clearcoat_normal_scale(materials, s.material);
    return normal_or_smooth(s, from_tangent_space(s, m, slopes_in(Texture_load(textures, image), slopes)));
}

// The normal perturbed by a height map (Blinn 1978) or a tangent-space normal map.
vec3 perturbed_normal(Surface s, Slopes slopes) {
    uint image = Material_bump_texture(materials, s.material);
    bool mapped = FX_NORMAL_MAPS && (!FX_BUMP_MAPS || (s.flags & MATERIAL_NORMAL_MAP) != 0u);
    bool given = FX_TANGENTS && mapped && s.tangent.w != 0.0;
    if (image == NONE || !(slopes.known || given)) return s.normal;
    vec3 dpdu = slopes.u, dpdv = slopes.v;
    vec2 uv = uv_of(s, image);
    Texture map = Texture_load(textures, image);
    // Texels that pass along u and along v: the picture is read at uv * scale + uv.yx * shear.
    vec2 size = vec2(map.width, map.height), extent = size * abs(map.scale);
    if (FX_TEXTURE_MODES) {
        vec2 across = (size * map.shear).yx;
        extent = sqrt(extent * extent + across * across);
    }
    vec2 texel = 1.0 / max(extent, 1e-6 * size);
    // The normal, or differences of heights half a texel to either side: along u, then along v.
    vec3 value;
    vec2 rise = vec2(0.0);
    int k = 0;
    do {
        vec2 offset = (k < 2 ? vec2(texel.x, 0.0) : vec2(0.0, texel.y)) * (k % 2 == 0 ? 0.5 : -0.5);
        value = texture_sample(image, mapped ? uv : uv + offset, false).xyz;
        rise += sign(offset) * value.r;
    } while (FX_BUMP_MAPS && !mapped && ++k < 4);
    vec3 n;
    if (mapped) {
        vec3 m = 2.0 * value - 1.0;
        m.xy *= Material_normal_scale(materials, s.material);
        n = from_tangent_space(s, m, slopes_in(map, slopes));
    } else {
        float height = Material_bump_scale(materials, s.material);
        vec3 pu = dpdu + s.normal * (height * (rise.x / texel.x) - dot(s.normal, dpdu));
        vec3 pv = dpdv + s.normal * (height * (rise.y / texel.y) - dot(s.normal, dpdv));
        n = cross(pu, pv);
        n = dot(n, s.normal) < 0.0 ? -n : n;
    }
    return normal_or_smooth(s, n);
}

// Normals and tangents that depend on how texture coordinates lie on the surface.
const bool SLOPES = FX_BUMP_MAPS || FX_NORMAL_MAPS || FX_COAT_NORMALS || FX_ANISOTROPIC, COORDINATES = FX_TEXTURES || SLOPES;

// Those of the coordinates at which `image` is read.
Slopes slopes_for(uint image, Slopes first, Slopes second) {
    if (FX_SECOND_UV && image != NONE) {
        if ((Texture_flags(textures, image) & TEXTURE_SECOND_UV) != 0u) return second;
    }
    return first;
}

// `first`, `second`: slopes of the two sets of coordinates.
void perturb(inout Surface s, Slopes first, Slopes second) {
    if (FX_COAT_NORMALS) {
        uint coat = Material_clearcoat_normal_texture(materials, s.material);
        s.coat_normal = perturbed_coat(s, slopes_for(coat, first, second));
    }
    Slopes slopes = slopes_for(Material_bump_texture(materials, s.material), first, second);
    if (FX_BUMP_MAPS || FX_NORMAL_MAPS) s.normal = perturbed_normal(s, slopes);
    if (FX_ANISOTROPIC && s.tangent.w == 0.0 && slopes.known) s.tangent.xyz = slopes.u;
}
