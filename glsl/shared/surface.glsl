// Computes what shading needs of a hit: position, normals, the resolved BSDF, emission.
#include "shared/bsdf.glsl"
#include "shared/texture.glsl"
#include "shared/octahedral.glsl"
#include "shared/segment.glsl"

struct Surface {
    vec3 position;  // world, interpolated from the vertices: more exact than origin + t * direction
    vec3 geometric; // unit, by the winding of the triangle
    vec3 smooth_normal; // unit, interpolated from the vertices, on the side that they point to
    vec3 normal;        // unit shading normal: the smooth one perturbed by a map
    vec3 coat_normal;   // the same of a clear coat, by a map of its own; with FX_COAT_NORMALS
    uint material;
    uint flags;     // of the material
    uint object;
    vec2 uv;
    vec2 second_uv; // as `uv` where the mesh has no second set
    vec4 color;     // of the vertices: linear, and opacity
    vec4 tangent;   // of the vertices: in world space, and the sign of the bitangent; 0 where the mesh has none, but with
                    // FX_ANISOTROPIC the direction of u
    vec3 corner, e1, e2; // the triangle in world space: its first vertex, and the edges from there
    float radius;    // of a sphere, whose centre is `corner`; 0 of a triangle
    float clearance; // distance from the plane at which rays start, world units
    float brightness; // that of the triangle's record
};

// Unit vector along `v`, and its length; both 0 where `v` is 0. The largest component is divided out first: the square of a
// triangle's area fits a float for edges between 3e-10 and 4e9 only.
vec3 unit_vector(vec3 v, out float len) {
    float largest = max(abs(v.x), max(abs(v.y), abs(v.z)));
    vec3 scaled = v / max(largest, 1e-37);
    float l = length(scaled);
    len = l * largest;
    return scaled / max(l, 1e-37);
}

// Distance along the unit normal at which a ray must start so that it meets no other triangle of the same plane. Rounding moves
// the interpolated point by about 2^-24 of the numbers that it is a sum of (`reach`), and the distance that the triangle test
// computes by as much of the triangle's size. A quarter of this distance sufficed for all but one in 10^4 rays, half for all.
const float CLEARANCE = 4.76837158203125e-7; // 2^-21

float plane_clearance(vec3 n, vec3 reach, vec3 e1, vec3 e2) {
    vec3 edge = max(abs(e1), abs(e2));
    return CLEARANCE * dot(abs(n), reach + max(edge.x, max(edge.y, edge.z)));
}

// Origin of a ray that leaves the surface towards `w`.
vec3 ray_origin(Surface s, vec3 w) {
    return s.position + (dot(w, s.geometric) < 0.0 ? -s.clearance : s.clearance) * s.geometric;
}

// Coordinates at which a surface reads a picture.
vec2 uv_of(Surface s, uint image) {
    return FX_SECOND_UV && (Texture_flags(textures, image) & TEXTURE_SECOND_UV) != 0u ? s.second_uv : s.uv;
}

#include "shared/normal_map.glsl"

// The sum of the magnitudes that `m` adds up for a point of coordinates up to `p`.
vec3 magnitude(mat4x3 m, vec3 p) {
    return abs(m[0]) * p.x + abs(m[1]) * p.y + abs(m[2]) * p.z + abs(m[3]);
}

// As surface_at, for a hit on a sphere. The point lies on it again, wherever along the ray it was met.
Surface sphere_at(Hit hit) {
    Surface s;
    Sphere ball = sphere_of(hit.triangle);
    vec3 n = octahedral_vector(vec2(hit.b1, hit.b2)), side = sphere_side(ball);
    float radius = length(ball.pole);
    vec3 reach = abs(ball.centre), point = radius * n;
    // Derivatives of the point by u and v.
    float equator = length(vec2(dot(n, ball.meridian), dot(n, side))) / radius; // distance from the axis
    vec3 around = (dot(n, ball.meridian) * side - dot(n, side) * ball.meridian) / radius;
    vec3 e1 = 2.0 * PI * around, e2 = (ball.pole - dot(n, ball.pole) * n) * (PI / max(equator, 1e-6));
    s.object = Triangle_object(triangles, hit.triangle);
    s.material = material_of(hit.triangle, hit.instance);
    s.corner = ball.centre;
    s.geometric = n;
    if (FX_INSTANCES && hit.instance != NONE) {
        mat4x3 world = world_from_object(hit.instance);
        mat4x3 object = object_from_world(hit.instance);
        float len;
        s.geometric = unit_vector(transpose(mat3(object)) * n, len);
        s.corner = world * vec4(ball.centre, 1.0);
        reach = magnitude(world, magnitude(object, abs(s.corner)));
        point = mat3(world) * point;
        e1 = mat3(world) * e1;
        e2 = mat3(world) * e2;
        radius = length(mat3(world) * ball.pole);
        s.object += Instance_object(instances, hit.instance);
    }
    if ((ball.flags & SPHERE_INWARD) != 0u) s.geometric = -s.geometric;
    s.flags = Material_flags(materials, s.material);
    s.position = s.corner + point;
    s.e1 = s.e2 = vec3(0.0);
    s.radius = radius;
    s.clearance = plane_clearance(s.geometric, reach, point, vec3(radius));
    s.smooth_normal = s.normal = s.coat_normal = s.geometric;
    s.uv = vec2(0.0);
    if (COORDINATES) s.uv = sphere_coordinates(ball, n);
    s.second_uv = s.uv;
    s.color = vec4(1.0);
    s.tangent = vec4(0.0);
    s.brightness = 0.0;
    Slopes slopes = Slopes(e1, e2, true);
    if (SLOPES) perturb(s, slopes, slopes);
    return s;
}

Surface surface_at(Hit hit) {
    if (FX_SPHERES && is_sphere(hit.triangle)) return sphere_at(hit);
    Surface s;
    Triangle triangle = Triangle_load(triangles, hit.triangle);
    vec3 p0 = triangle.v0;
    vec3 e1 = triangle.v1 - p0;
    vec3 e2 = triangle.v2 - p0;
    s.object = triangle.object;
    s.material = material_of(hit.triangle, hit.instance);
    vec3 reach = abs(p0);
    mat3 normals_from_object = mat3(1.0);
    bool mirrored = false;
    if (FX_INSTANCES && hit.instance != NONE) {
        mat4x3 world = world_from_object(hit.instance);
        mat4x3 object = object_from_world(hit.instance);
        normals_from_object = transpose(mat3(object));
        p0 = world * vec4(p0, 1.0);
        // Rays are transformed to object space and points from it, which both round.
        reach = magnitude(world, magnitude(object, abs(p0)));
        e1 = mat3(world) * e1;
        e2 = mat3(world) * e2;
        s.object += Instance_object(instances, hit.instance);
        mirrored = Instance_mirrored(instances, hit.instance) != 0u;
    }
    s.flags = Material_flags(materials, s.material);
    s.position = p0 + hit.b1 * e1 + hit.b2 * e2;
    s.corner = p0;
    s.e1 = e1;
    s.e2 = e2;
    s.radius = 0.0;
    vec3 scaled = mirrored ? cross(e2, e1) : cross(e1, e2);
    float doubled_area;
    s.geometric = unit_vector(scaled, doubled_area); // a needle that rounds to no area scatters nothing
    s.clearance = plane_clearance(s.geometric, reach, e1, e2);
    s.smooth_normal = s.normal = s.coat_normal = s.geometric;
    s.uv = s.second_uv = vec2(0.0);
    s.color = vec4(1.0);
    s.tangent = vec4(0.0);
    s.brightness = 0.0;
    if (!(FX_SMOOTH_NORMALS || FX_VERTEX_COLORS || COORDINATES)) return s;

    Shading at = Shading_load(shading, hit.triangle);
    s.brightness = at.brightness;
    if (FX_SMOOTH_NORMALS && (at.normal.x & at.normal.y & at.normal.z) != 0xffffffffu) {
        vec3 n0 = octahedral_decode(at.normal.x), n1 = octahedral_decode(at.normal.y), n2 = octahedral_decode(at.normal.z);
        float len;
        if (FX_INSTANCES && hit.instance != NONE) {
            // As of a mesh that is stored where it stands: scales that differ would let one normal count for more than another.
            n0 = unit_vector(normals_from_object * n0, len);
            n1 = unit_vector(normals_from_object * n1, len);
            n2 = unit_vector(normals_from_object * n2, len);
        }
        vec3 n = unit_vector(mix(n0, n1, hit.b1) + hit.b2 * (n2 - n0), len);
        s.smooth_normal = s.normal = s.coat_normal = len > 0.0 ? n : s.geometric;
    }
    if (FX_VERTEX_COLORS) s.color = vertex_color(at, vec2(hit.b1, hit.b2));
    if (FX_TANGENTS) {
        s.tangent = vertex_tangent(at, vec2(hit.b1, hit.b2));
        if (FX_INSTANCES && hit.instance != NONE) {
            s.tangent.xyz = mat3(world_from_object(hit.instance)) * s.tangent.xyz;
            s.tangent.w = mirrored ? -s.tangent.w : s.tangent.w;
        }
    }
    if (COORDINATES) {
        vec2 d1 = at.uv1 - at.uv0, d2 = at.uv2 - at.uv0;
        s.uv = s.second_uv = at.uv0 + hit.b1 * d1 + hit.b2 * d2;
        Slopes first = slopes_of(e1, e2, d1, d2), second = first;
        if (FX_SECOND_UV) {
            take_second_coordinates(at);
            d1 = at.uv1 - at.uv0;
            d2 = at.uv2 - at.uv0;
            s.second_uv = at.uv0 + hit.b1 * d1 + hit.b2 * d2;
            second = slopes_of(e1, e2, d1, d2);
        }
        if (SLOPES) perturb(s, first, second);
    }
    return s;
}

// Vertex normals and maps turn the shading normal away from the plane of its triangle.
const bool MAPS = FX_BUMP_MAPS || FX_NORMAL_MAPS, SHADING_NORMALS = FX_SMOOTH_NORMALS || MAPS;

// 1 where `w` leaves the surface on the side of its normals, else -1. The triangle's plane decides, since the shading normal of
// a coarse mesh turns away from the viewer before the silhouette.
float side_of(Surface s, vec3 w) {
    return dot(s.smooth_normal, s.geometric) * dot(s.geometric, w) < 0.0 ? -1.0 : 1.0;
}

// The normals of a surface for a viewer: the smooth one, and the one that lobes are around.
struct Facing {
    vec3 smooth_normal;
    vec3 normal;
    float shadowed; // share of the lobes that maps shadow, see light_share
};

const float MIN_ELEVATION = 1e-3; // sine of a direction's elevation above the horizon after bending

// Normals for a viewer towards `wo`, on the viewer's side where the surface `turns`. A smooth normal that faces away is bent until
// `wo` is above its horizon, and for surfaces with a mirror image (`mirrors`) until that image is above the plane (Keller et al.
// 2017, "The Iray light transport simulation and rendering system", A.3; departure: along the plane's normal, which is always
// defined). A map's normal that faces away is turned by half a turn around the smooth one, as in Mitsuba 3.
Facing facing_normals(Surface s, vec3 wo, bool turns, bool mirrors) {
    float side = side_of(s, wo);
    vec3 n = side * s.smooth_normal, mapped = side * s.normal;
    if (SHADING_NORMALS) {
        float along = dot(n, wo);
        vec3 plane = dot(n, s.geometric) < 0.0 ? -s.geometric : s.geometric;
        vec3 image = 2.0 * along * n - wo;
        float height = dot(image, plane);
        bool bent = (mirrors ? height : along) < 0.0;
        if (bent) n = normalize(mirrors ? wo + normalize(image + (MIN_ELEVATION - height) * plane) : n + (MIN_ELEVATION - along) * wo);
        if (bent) mapped = n;
        if (MAPS && dot(mapped, wo) < 0.0) mapped = 2.0 * dot(mapped, n) * n - mapped;
    }
    float back = turns ? 1.0 : side;
    return Facing(back * n, back * mapped, 1.0);
}

// The normals for a material that reflects the share `specular` of its light at its surface. A map's slope may send the mirror image
// of `wo` into the surface: of metals, nothing would be left of it, so that slopes would be black. The surface reflects it once
// more: the normal is that between `wo` and the image turned up again. Nor do maps shadow what a metal mirrors.
Facing facing_of_metal(Surface s, Facing f, vec3 wo, float specular) {
    if (!MAPS || s.normal == s.smooth_normal) return f;
    f.shadowed = 1.0 - specular;
    vec3 plane = dot(f.smooth_normal, s.geometric) < 0.0 ? -s.geometric : s.geometric;
    vec3 image = 2.0 * dot(f.normal, wo) * f.normal - wo;
    float height = dot(image, plane);
    if (specular < 0.5 || height >= 0.0 || dot(plane, wo) <= 0.0) return f;
    vec3 between = wo + image - 2.0 * height * plane;
    f.normal = between * inversesqrt(max(dot(between, between), 1e-30));
    return f;
}

// The normals for a material at `s`. That of a dielectric stays on its outside, since its two sides differ.
Facing facing_of(Surface s, Bsdf b, vec3 wo) {
    bool turns = (s.flags & MATERIAL_TWO_SIDED) != 0u && !is_kind(FX_DIELECTRIC, b, BSDF_DIELECTRIC);
    Facing facing = facing_normals(s, wo, turns, bsdf_is_specular(b));
    if (is_kind(FX_METALLIC, b, BSDF_METALLIC)) facing = facing_of_metal(s, facing, wo, metallic_specular(b.metallic));
    return facing;
}

// The frame of lobes around `n`: x leads along the tangent where roughness depends on the direction.
mat3 shading_basis(Surface s, Bsdf b, vec3 n) {
    if (FX_ANISOTROPIC && b.stretch != 1.0) {
        float length_along;
        vec3 t = unit_vector(s.tangent.xyz - n * dot(n, s.tangent.xyz), length_along);
        if (length_along > 0.0) return mat3(t, cross(n, t), n);
    }
    return basis_from_normal(n);
}

// The normal of a clear coat in the frame `basis`; that of the frame where the viewer towards `wo` would be below it.
vec3 local_coat_normal(Surface s, Facing f, mat3 basis, vec3 wo) {
    vec3 n = dot(f.smooth_normal, s.smooth_normal) < 0.0 ? -s.coat_normal : s.coat_normal;
    if (s.coat_normal == s.smooth_normal) n = f.smooth_normal;
    n = n * basis; // row vector times matrix: into the frame
    return dot(n, wo) > MIN_ELEVATION ? n : UP;
}

// A surface as a viewer sees it: the frame of its lobes, and the viewer in that frame.
struct View {
    Facing facing;
    mat3 basis; // its columns are the shading frame
    vec3 wo;    // unit, to the viewer, in that frame
};

// For a viewer towards `towards`, in world space. Prepares `bsdf` to be evaluated and sampled.
View view_of(Surface s, inout Bsdf bsdf, Facing facing, vec3 towards) {
    mat3 basis = shading_basis(s, bsdf, facing.normal);
    vec3 wo = towards * basis; // row vector times matrix: into the frame
    if (FX_COAT_NORMALS) bsdf.metallic.coat_normal = local_coat_normal(s, facing, basis, wo);
    bsdf_view(bsdf, wo);
    return View(facing, basis, wo);
}

// Share of the light along `w` that lobes around `facing.normal` keep; `z` is the component of `w` along that normal. It is 0
// where the plane and the normal disagree about the side of `w`, or an opaque surface would see its own inside. Maps shadow
// themselves (Conty Estevez, Lecocq and Stein 2019, Ray Tracing Gems, chapter 12).
float light_share(Surface s, Facing facing, vec3 w, float z) {
    if (!SHADING_NORMALS) return 1.0;
    bool crosses = dot(facing.normal, s.geometric) * dot(s.geometric, w) * z < 0.0;
    if (!MAPS || crosses || s.normal == s.smooth_normal) return crosses ? 0.0 : 1.0;
    float tilt = dot(facing.normal, facing.smooth_normal), up = dot(w, facing.smooth_normal);
    if (up * z <= 0.0) return 0.0;
    float alpha2 = min(0.125 * (1.0 / max(tilt * tilt, 1e-6) - 1.0), 1.0);
    float share = 2.0 / (1.0 + sqrt(1.0 + max(alpha2, 0.0) * max(1.0 / max(up * up, 1e-12) - 1.0, 0.0)));
    return FX_METALLIC ? mix(1.0, share, facing.shadowed) : share;
}

vec3 textured(vec3 constant, uint image, Surface s) {
    if (!FX_TEXTURES || image == NONE) return constant;
    return constant * texture_sample(image, uv_of(s, image), true).rgb;
}

// A number times the red channel of a picture.
float scaled(float constant, uint image, Surface s) {
    if (!FX_TEXTURES || image == NONE) return constant;
    return constant * texture_sample(image, uv_of(s, image), false).r;
}

// Share of the light of a lamp that leaves its clear coat at `cosine` to the normal of its triangle: the coat is above what emits
// (KHR_materials_clearcoat). Both ways to find the lamp have the same.
float coat_lets_out(uint material, vec4 coordinates, float cosine) {
    float coat = Material_clearcoat(materials, material);
    if (coat == 0.0 || Material_kind(materials, material) != BSDF_METALLIC) return 1.0;
    coat = textured_at(vec3(coat), Material_clearcoat_texture(materials, material), coordinates, false).r;
    return 1.0 - coat * mix(COAT_F0, 1.0, schlick_weight(min(cosine, 1.0)));
}

// Radiance that the surface emits towards a viewer at `cosine` to the normal of its triangle.
vec3 surface_emission(Surface s, float cosine) {
    vec3 emission = Material_emission(materials, s.material);
    if (FX_VERTEX_COLORS && (s.flags & MATERIAL_UNLIT) != 0u) emission *= s.color.rgb;
    if (FX_CLEARCOAT) emission *= coat_lets_out(s.material, vec4(s.uv, s.second_uv), cosine);
    if (!FX_TEXTURES) return emission;
    uint image = Material_emission_texture(materials, s.material);
    return image == NONE ? emission : emission * texture_sample(image, uv_of(s, image), true).rgb;
}

// The layers of a metallic-roughness material, whose base colour is known.
Metallic surface_metallic(Material m, vec3 base, Surface s) {
    vec3 factors = vec3(1.0); // of roughness in g, of metal in b
    if (FX_TEXTURES && m.roughness_texture != NONE)
        factors = texture_sample(m.roughness_texture, uv_of(s, m.roughness_texture), false).rgb;
    vec3 f0 = textured(m.specular, m.specular_texture, s);
    float through = 0.0;
    if (FX_THIN) through = scaled(m.transmission_factor, m.transmission_texture, s);
    vec2 coat = vec2(0.0);
    if (FX_CLEARCOAT && m.clearcoat > 0.0) {
        coat.x = scaled(m.clearcoat, m.clearcoat_texture, s);
        float r = scaled(1.0, m.clearcoat_roughness_texture, s);
        coat.y = m.clearcoat_alpha * r * r;
    }
    return metallic_layers(base, m.metallic * factors.b, f0, scaled(m.specular_factor, m.specular_factor_texture, s), through,
                           m.alpha * factors.g * factors.g, coat.x, coat.y, m.coat_table);
}

// The material with its textures looked up. The compiler drops fetches for effects that the scene does not have.
Bsdf surface_bsdf(Surface s) {
    Material m = Material_load(materials, s.material);
    Bsdf b;
    b.kind = ONE_KIND ? BSDF_DIFFUSE : m.kind;
    b.albedo = textured(m.base_color, m.base_texture, s);
    if (FX_VERTEX_COLORS) b.albedo *= s.color.rgb;
    b.transmission = m.transmission;
    b.ggx = (s.flags & MATERIAL_GGX) != 0u;
    b.alpha = 0.0;
    b.stretch = 1.0;
    b.eta = vec3(1.0);
    b.k = vec3(0.0);
    b.specular = vec3(0.0);
    b.internal_fresnel = 0.0;
    b.coat_table = 0u;
    b.coat_row = 0.0;
    b.coat_outside = 0.0;
    b.coat_inside = 0.0;
    b.nonlinear = (s.flags & MATERIAL_NONLINEAR) != 0u;
    if (is_kind(FX_METALLIC, b, BSDF_METALLIC)) b.metallic = surface_metallic(m, b.albedo, s);
    if (FX_CONDUCTOR || FX_DIELECTRIC || FX_COATED) {
        b.eta = m.eta;
        b.k = m.k;
        b.alpha = m.alpha;
        if (FX_ANISOTROPIC) b.stretch = 1.0 + m.anisotropy;
        b.specular = textured(m.specular, m.specular_texture, s);
        if (FX_COATED) {
            b.internal_fresnel = m.internal_fresnel;
            b.coat_table = m.coat_table;
        }
        if (FX_TEXTURES && m.roughness_texture != NONE) {
            float r = texture_sample(m.roughness_texture, uv_of(s, m.roughness_texture), false).r; // perceptual: alpha = r^2
            b.alpha *= r * r;
        }
        // Neither a picture nor a key makes it smooth along one direction alone.
        if (FX_ANISOTROPIC && b.stretch != 1.0) {
            float across = b.alpha * b.stretch;
            if (max(b.alpha, across) >= SMOOTH_ALPHA) {
                b.alpha = max(b.alpha, SMOOTH_ALPHA);
                b.stretch = max(across, SMOOTH_ALPHA) / b.alpha;
            }
        }
    }
    return b;
}
