// Choice of a light by an alias table in proportion to power, by what it brings, or by the tree of light_tree.glsl, sampling of a point
// on it, and the densities for MIS.
#include "shared/surface.glsl"
#include "shared/segment.glsl"
#include "shared/luminance.glsl"

layout(binding = 7) uniform usamplerBuffer lights; // of Light
layout(binding = 8) uniform usamplerBuffer light_table; // of AliasEntry
layout(binding = 9) uniform samplerBuffer environment; // of vec4
layout(binding = 10) uniform usamplerBuffer environment_table; // of AliasEntry
layout(binding = 20) uniform usamplerBuffer light_nodes; // of LightNode

struct LightSample {
    vec3 direction; // unit, from the surface to the light
    float distance; // to the offset point on the light, world units; huge for lights at infinity
    vec3 radiance;  // already divided by the probability of the sample
    float pdf;      // per solid angle, for MIS; 0 for lights that no BSDF sample can hit
    float sharp;    // of a light without extent, whose shadows are sharp, the probability that it is chosen; else 0
    uint chosen;    // index of the light; NONE if none can bring anything
    uint key;       // with FX_SOFT that of the key light, if the point has one of which anything is kept; else NONE
    float kept;     // the share that is kept of the key light
};

// What light is sampled for.
struct Receiver {
    vec3 position;
    vec3 normal;     // of the lobes, on the viewer's side
    bool lets_light_through;
    float odds_beyond_cosine; // added to the cosine in the odds of a light, for lobes that reflect more than the cosine says
    vec3 viewer;              // unit, towards it
    float gloss;              // by which the lobe around the mirror image of the viewer counts beside the cosine; 0 without that lobe
    float alpha2;             // squared roughness of that lobe, above 0
};

// The key light of a point is the light without extent that it chooses most often. A share of its light is kept apart, as its shadows are
// sharp; that of all others has the noise of the choice, and a filter takes it with what is soft.
struct KeyLight {
    uint index;
    float probability; // of the choice
    float rival;       // that of the likeliest other light without extent; 0 without one
};

// Takes a light without extent for the key light, if it is chosen more often than those before; else it may be their rival.
void consider(inout KeyLight key, uint light, float probability) {
    if (probability > key.probability) key = KeyLight(light, probability, key.probability);
    else key.rival = max(key.rival, probability);
}

// Of one that is chosen so seldom nothing is kept, as most samples pass it over; and all, if nothing rivals it, at twice that probability,
// where four samples, whose choices are spread evenly, hold at least one of it.
const float KEY_PROBABILITY = 0.2;

// The share that is kept. It is 0 where another light becomes the key light: a step in what is kept is one the other way round in what is
// filtered, and a filter that blurs it leaves lines on smooth floors.
float kept_share(KeyLight key) {
    if (key.probability <= KEY_PROBABILITY) return 0.0;
    float rival = key.rival / key.probability;
    return min(key.probability / KEY_PROBABILITY - 1.0, 1.0) * (1.0 - rival * rival);
}

const float MAX_ODDS = 1e30; // so that sums of odds stay finite

// The slot of an alias table of `n` that the word `random` chooses.
uint alias_slot(uint n, uint random) {
    uint slot, low;
    umulExtended(random, n, slot, low);
    return slot;
}

// Chooses the slot that `random` does or its alias, where `entry` is that slot's. Replaces `random` by its position within the
// choice's share of the slot: a word independent of the choice and as well stratified. A hash fills up the bits that the
// choice of the slot used, before the rest decides: of 2^25 slots it leaves 128 steps within each, by which aliases, among them
// the sun of a large sky, would be chosen too seldom.
uint alias_choose(AliasEntry entry, uint n, inout uint random) {
    uint slot, low, fill, rest, hash = pcg(random);
    umulExtended(random, n, slot, low);
    umulExtended(hash, n, fill, rest);
    low += min(fill, 0xffffffffu - low);
    bool stays = low < entry.threshold;
    float into = float(stays ? low : low - entry.threshold);
    float share = stays ? float(entry.threshold) : 4294967296.0 - float(entry.threshold);
    random = word_of_unit(into / share, hash);
    return stays ? slot : entry.alias;
}

// Coordinates of a direction in the environment's own frame (row 0 is +y): u = atan(x, -z) / 2 pi, v = acos(y) / pi, the latter
// by atan, since acos is inexact near the poles. `sine` = length(d.xz). At a pole atan(0, 0) may be no number.
vec2 environment_uv(vec3 d, float sine) {
    return vec2(sine > 0.0 ? atan(d.x, -d.z) * (0.5 / PI) : 0.0, atan(sine, d.y) / PI);
}

mat3 environment_rotation(uint light) { // environment_from_world
    return transpose(mat3(Light_a(lights, light), Light_b(lights, light), Light_c(lights, light)));
}

// Radiance without its scale, and in w the density by which texels are drawn, both bilinear: columns wrap, rows clamp.
vec4 environment_lookup(vec2 uv) {
    ivec2 size = ivec2(push.constants.environment_size);
    vec2 at = uv * vec2(size) - 0.5;
    ivec2 p = ivec2(floor(at));
    vec2 f = at - vec2(p);
    // From a direction that is no number any integer may come.
    int x0 = clamp(p.x < 0 ? p.x + size.x : p.x >= size.x ? p.x - size.x : p.x, 0, size.x - 1);
    int x1 = x0 + 1 == size.x ? 0 : x0 + 1;
    int y0 = clamp(p.y, 0, size.y - 1) * size.x, y1 = clamp(p.y + 1, 0, size.y - 1) * size.x;
    vec4 top = mix(texelFetch(environment, y0 + x0), texelFetch(environment, y0 + x1), f.x);
    vec4 low = mix(texelFetch(environment, y1 + x0), texelFetch(environment, y1 + x1), f.x);
    return mix(top, low, f.y);
}

// Density per solid angle where the look-up returns `p` in w, given the sine of the polar angle.
float environment_pdf(uint light, float p, float sine) {
    uvec2 size = push.constants.environment_size;
    return Light_probability(lights, light) * p * float(size.x) * float(size.y) / (2.0 * PI * PI * max(sine, 1e-6));
}

// Radiance from `direction` and the density with which light_sample would choose it (solid angle).
vec3 environment_radiance(vec3 direction, out float pdf) {
    vec3 scale = Light_value(lights, push.constants.environment);
    pdf = Light_probability(lights, push.constants.environment) * (0.25 / PI);
    if (!FX_ENVIRONMENT_MAP || push.constants.environment_size.x == 0u) return scale;
    vec3 d = environment_rotation(push.constants.environment) * direction;
    float sine = length(d.xz);
    vec2 uv = environment_uv(d, sine);
    uv.x -= floor(uv.x);
    vec4 found = environment_lookup(uv);
    pdf = environment_pdf(push.constants.environment, found.w, sine);
    return scale * found.rgb;
}

void sample_environment(uint light, float chosen, uint word, vec2 u, inout LightSample s) {
    s.distance = INFINITE_DISTANCE;
    s.radiance = Light_value(lights, light);
    if (!FX_ENVIRONMENT_MAP || push.constants.environment_size.x == 0u) {
        s.direction = warp_sphere(u);
        s.pdf = chosen * (0.25 / PI);
    } else {
        uvec2 size = push.constants.environment_size;
        uint count = size.x * size.y;
        uint texel = alias_choose(AliasEntry_load(environment_table, alias_slot(count, word)), count, word);
        // Tents around the centres of texels add up to bilinear interpolation; what ends beyond a pole is folded back, since rows clamp.
        vec2 at = vec2(texel % size.x, texel / size.x) + 0.5 + vec2(warp_tent(u.x), warp_tent(u.y));
        vec2 uv = at / vec2(size);
        uv.y = 1.0 - abs(1.0 - abs(uv.y));
        vec2 azimuth = circle_point(uv.x - floor(uv.x)), polar = sine_cosine(PI * uv.y);
        s.direction = transpose(environment_rotation(light)) * vec3(azimuth.y * polar.x, polar.y, -azimuth.x * polar.x);
        vec4 found = environment_lookup(uv);
        s.pdf = environment_pdf(light, found.w, polar.x);
        s.radiance *= found.rgb;
    }
    s.radiance = s.pdf > 0.0 ? s.radiance / s.pdf : vec3(0.0);
}

// A triangle seen from a point: unit vectors to its corners, and its solid angle in steradians (Van Oosterom and Strackee 1983).
// The volume in that formula is computed from the edges, since the unit vectors of a small triangle hardly differ.
struct SphericalTriangle {
    vec3 a, b, c;
    float solid_angle;
    float volume; // of the parallelepiped that the three vectors span
};

SphericalTriangle spherical_triangle(vec3 a, vec3 e1, vec3 e2) {
    vec3 b = a + e1, c = a + e2;
    vec3 inverse = inversesqrt(max(vec3(dot(a, a), dot(b, b), dot(c, c)), 1e-37));
    SphericalTriangle t = SphericalTriangle(a * inverse.x, b * inverse.y, c * inverse.z, 0.0, 0.0);
    t.volume = abs(dot(t.a, cross(e1 * inverse.y, e2 * inverse.z)));
    t.solid_angle = 2.0 * atan(t.volume, 1.0 + dot(t.a, t.b) + dot(t.b, t.c) + dot(t.c, t.a));
    return t;
}

// Between these limits sampling by solid angle lowers noise and is exact in single precision; elsewhere it is by area.
const float MIN_SOLID_ANGLE = 3e-4, MAX_SOLID_ANGLE = 6.0; // steradians
const float MIN_VOLUME = 1e-3; // per steradian: wide triangles that are closer lie in a plane with the point, up to rounding

bool by_solid_angle(SphericalTriangle t) {
    return FX_LARGE_LAMPS && t.solid_angle > MIN_SOLID_ANGLE && t.solid_angle < MAX_SOLID_ANGLE
        && t.volume > MIN_VOLUME * t.solid_angle;
}

// Samples a direction uniformly by solid angle (Arvo 1995): u.x cuts off the triangle `a`, `b`, d with d on the arc from `a` to
// `c`, and u.y chooses a point of the arc from `b` to d. tan(ad / 2) follows from the formula of the solid angle of `a`, `b`, d.
vec3 sample_spherical_triangle(SphericalTriangle t, vec2 u) {
    float half_angle = 0.5 * u.x * t.solid_angle;
    vec3 along = normalize(t.c - dot(t.a, t.c) * t.a);
    float volume = abs(dot(cross(t.a, t.b), along));
    vec2 turn = sine_cosine(half_angle);
    float half_tan = (1.0 + dot(t.a, t.b)) * turn.x / max(volume * turn.y - dot(t.b, along) * turn.x, 1e-10);
    vec3 d = ((1.0 - half_tan * half_tan) * t.a + 2.0 * half_tan * along) / (1.0 + half_tan * half_tan);
    vec3 chord = d - t.b;
    float rest = 0.5 * u.y * dot(chord, chord); // 1 - cosine of the part of the arc
    vec3 across = d - dot(d, t.b) * t.b;
    return (1.0 - rest) * t.b + sqrt(rest * (2.0 - rest)) * across * inversesqrt(max(dot(across, across), 1e-30));
}

// Where the shadow ray to a lamp `distance` away ends, so that it does not meet the lamp: `clearance` before the lamp's plane, which it
// meets at an angle of this cosine. What the lamp brings is computed from the lamp itself: from a point moved off it, one that is close or
// wide would look smaller than it counts.
float distance_before(float distance, float clearance, float cosine) {
    return max(distance - clearance / max(cosine, 1e-6), 0.5 * distance);
}

void sample_triangle_light(vec3 p, Light light, vec2 u, inout LightSample s) {
    vec2 bary = warp_triangle(u);
    vec3 a = light.a, e1 = light.b - a, e2 = light.c - a;
    float doubled_area;
    vec3 n = unit_vector(cross(e1, e2), doubled_area);
    SphericalTriangle seen = SphericalTriangle(vec3(0.0), vec3(0.0), vec3(0.0), 0.0, 0.0);
    if (FX_LARGE_LAMPS) {
        seen = spherical_triangle(a - p, e1, e2);
        vec3 w = sample_spherical_triangle(seen, u);
        vec3 q = dot(a - p, n) / dot(w, n) * w - (a - p);
        vec2 at = clamp(vec2(dot(cross(q, e2), n), dot(cross(e1, q), n)) / doubled_area, 0.0, 1.0);
        if (by_solid_angle(seen)) bary = at;
    }
    vec3 on_light = a + bary.x * e1 + bary.y * e2;
    bool two_sided = FX_TWO_SIDED_LAMPS && (Material_flags(materials, light.material) & MATERIAL_EMITS_BEHIND) != 0u;
    if (two_sided && dot(n, a - p) > 0.0) n = -n; // the side that emits towards `p`
    vec3 to_light = on_light - p;
    float d2 = dot(to_light, to_light), distance = sqrt(d2);
    s.direction = to_light / distance;
    float cosine = -dot(n, s.direction);
    s.distance = distance_before(distance, plane_clearance(n, abs(a), e1, e2), cosine);
    vec3 radiance = light.value;
    // What belongs to corners is stored in the order of the triangle.
    vec2 stored = light.kind == LIGHT_MIRRORED ? bary.yx : bary;
    if (FX_TEXTURES) {
        uint image = Material_emission_texture(materials, light.material);
        if (image != NONE) radiance *= texture_sample(image, uv_of(texture_coordinates(light.triangle, stored), image), true).rgb;
    }
    if (FX_VERTEX_COLORS && (Material_flags(materials, light.material) & MATERIAL_UNLIT) != 0u)
        radiance *= vertex_color(Shading_load(shading, light.triangle), stored).rgb;
    if (FX_CLEARCOAT) {
        vec4 coordinates = FX_TEXTURES ? texture_coordinates(light.triangle, stored) : vec4(0.0);
        radiance *= coat_lets_out(light.material, coordinates, cosine);
    }
    // The shadow ray ends before the light, so that the light's own mask counts here.
    if (FX_ALPHA_MASKS) radiance *= surface_opacity(light.material, light.triangle, stored);
    bool lit = cosine > 0.0 && d2 > 0.0;
    s.pdf = lit ? light.probability * 2.0 * d2 / (cosine * doubled_area) : 0.0;
    if (lit && by_solid_angle(seen)) s.pdf = light.probability / seen.solid_angle;
    s.radiance = lit ? radiance / s.pdf : vec3(0.0);
}

// 1 - cosine of half the angle that a sphere subtends, seen from outside; 0 from inside. It keeps its digits for small spheres.
float sphere_cap(vec3 to_centre, float radius) {
    float sine2 = radius * radius / max(dot(to_centre, to_centre), 1e-37);
    return sine2 < 1.0 ? sine2 / (1.0 + sqrt(1.0 - sine2)) : 0.0;
}

// Samples a sphere uniformly by solid angle in the cone that it subtends. The point is computed from the cone's sine, since a
// far sphere is smaller than the rounding of direction times distance.
void sample_sphere_light(vec3 p, Light light, vec2 u, inout LightSample s) {
    float radius = light.b.x;
    vec3 to_centre = light.a - p;
    float cap = sphere_cap(to_centre, radius), distance;
    vec3 axis = unit_vector(to_centre, distance), w = warp_cone(u, cap);
    float sine2 = dot(w.xy, w.xy);
    float along = distance * w.z - sqrt(max(radius * radius - distance * distance * sine2, 0.0));
    vec2 across = w.xy * (along / radius);
    vec3 n = basis_from_normal(axis) * vec3(across, -sqrt(max(1.0 - dot(across, across), 0.0)));
    vec3 to_light = to_centre + radius * n;
    float d2 = dot(to_light, to_light);
    distance = sqrt(d2);
    s.direction = to_light / distance;
    float cosine = -dot(n, s.direction);
    s.distance = distance_before(distance, plane_clearance(n, abs(light.a), vec3(radius), vec3(0.0)), cosine);
    bool lit = cap > 0.0 && d2 > 0.0 && cosine > 0.0;
    s.pdf = lit ? light.probability / (2.0 * PI * cap) : 0.0;
    vec3 radiance = light.value;
    if (FX_CLEARCOAT) radiance *= coat_lets_out(light.material, vec4(0.0), cosine); // lamps with pictures are no spheres
    s.radiance = lit ? radiance / s.pdf : vec3(0.0);
}

// Share of a spot's intensity along `w`, from the point that it lights: it falls off smoothly between the two angles, linear in the
// angle.
float spot_share(Light light, vec3 w) {
    float angle = atan(length(cross(light.b, w)), -dot(light.b, w));
    return clamp((light.c.y - angle) / max(light.c.y - light.c.x, 1e-6), 0.0, 1.0);
}

bool is_point_or_spot(uint kind) { return kind == LIGHT_POINT || kind == LIGHT_SPOT; }

bool is_triangle_light(uint kind) { return kind == LIGHT_TRIANGLE || kind == LIGHT_MIRRORED; }

bool is_sphere_light(uint kind) { return FX_SPHERES && kind == LIGHT_SPHERE; }

// What the odds of lights along `w` get for the lobe around the mirror image of the viewer. Its microfacets are GGX, whatever those of the
// surface. Those of lights that fill a cone around `w` are rougher by `spread`, half of 1 - cosine of half its angle: as the half
// vector turns by half of what a direction does, that keeps what all of the lobe reflects, if the cone is narrow.
float odds_of_lobe(Receiver r, vec3 w, float spread) {
    vec3 h = r.viewer + w;
    float along = dot(r.normal, h), alpha2 = r.alpha2 + spread;
    vec3 across = h - along * r.normal;
    float across2 = dot(across, across), along2 = along > 0.0 ? along * along : 0.0, wide = across2 + alpha2 * along2;
    float shape = (across2 + along2) / max(wide, 1e-30);
    return r.gloss * alpha2 * shape * shape;
}

bool is_directional(uint kind) { return FX_DIRECTIONAL && kind == LIGHT_DIRECTIONAL; }

bool is_delta_light(uint kind) { return is_point_or_spot(kind) || is_directional(kind); }

// What a delta light brings to a receiver from which it is seen, up to a factor that all have.
float unshadowed(Light light, Receiver r) {
    bool is_sun = is_directional(light.kind);
    vec3 to_light = is_sun ? -light.b : light.a - r.position;
    float d2 = is_sun ? 1.0 : max(dot(to_light, to_light), 1e-30), emits = 1.0;
    vec3 w = to_light * inversesqrt(d2);
    float cosine = dot(r.normal, w);
    if (r.lets_light_through) cosine = abs(cosine);
    if (FX_SPOT && light.kind == LIGHT_SPOT) emits = spot_share(light, w);
    float reflects = cosine + r.odds_beyond_cosine;
    if (FX_ROUGH) reflects += odds_of_lobe(r, w, 0.0);
    float brings = min(emits * reflects * luminance(light.value) / d2, MAX_ODDS);
    return cosine > 0.0 || r.lets_light_through ? brings : 0.0;
}

// Share of the choices in which all lights that bring anything are alike: one that would bring much, but for a wall before it, starves
// the others. A lamp beside a hidden one of 1, 100 and 10,000 times its power, 16 samples a pixel: relMSE .0043, .49 and 11 without,
// .0054, .22 and .76 with this share, .0056, .15 and .32 with .1, which costs more noise where nothing is hidden.
const float EVEN_SHARE = 0.05;

// Chooses anew among the delta lights, one of which the table has chosen: by what each would bring if nothing were in its way (resampling of
// all candidates: Talbot, Cline and Egbert 2005). All lamps count together, and all suns, by what they bring to the power of 3/4: below 1,
// a sun behind a wall leaves more of the choices to lamps. Powers of 1/2, .7 and 1 had 1, .94 and .98 of the relMSE at 4 samples in seven
// scenes with suns and lamps, .7 and 3/4 1 and .995 in ten. Lights with a surface lie behind the others.
Light choose_by_share(Receiver r, float u, out uint index, out KeyLight key) {
    Light chosen = Light_load(lights, 0u);
    index = NONE;
    key = KeyLight(NONE, 0.0, 0.0);
    vec2 sums = vec2(0.0); // of lamps, and of lights at infinity
    float number = 0.0, group = 0.0;
    uint end = 0u;
    for (; end < push.constants.light_count; end++) {
        Light light = Light_load(lights, end);
        if (is_triangle_light(light.kind) || light.kind == LIGHT_SPHERE) break;
        if (!is_delta_light(light.kind)) continue;
        float brings = unshadowed(light, r);
        sums += is_directional(light.kind) ? vec2(0.0, brings) : vec2(brings, 0.0);
        number += brings > 0.0 ? 1.0 : 0.0;
        group += light.probability;
    }
    vec2 kinds = sqrt(sums) * sqrt(sqrt(sums));
    kinds /= kinds.x + kinds.y;
    // Each light has one interval of [0, 1), so that numbers which are spread evenly there choose lights evenly.
    float before = 0.0;
    for (uint i = 0u; i < end && number > 0.0 && (FX_SOFT || u >= before); i++) {
        Light light = Light_load(lights, i);
        float brings = is_delta_light(light.kind) ? unshadowed(light, r) : 0.0;
        if (brings <= 0.0) continue;
        float odds = is_directional(light.kind) ? kinds.y * (brings / sums.y) : kinds.x * (brings / sums.x);
        float share = mix(odds, 1.0 / number, EVEN_SHARE);
        if (FX_SOFT) consider(key, i, group * share);
        if (u >= before) { // in the end the last, if rounding leaves something
            chosen = light;
            chosen.probability = group * share;
            index = i;
        }
        before += share;
    }
    if (index == NONE) {
        chosen.probability = group;
        chosen.value = vec3(0.0);
    }
    return chosen;
}

#include "shared/light_tree.glsl"

// Density over area by which MIS takes a lamp to be chosen: by the table, or with a tree as much more often as its part of a picture is
// brighter than the whole.
float lamp_density(uint material, float brightness) {
    float density = push.constants.triangle_pdf_scale * Material_emission_weight(materials, material);
    return FX_LIGHT_TREE && FX_TEXTURES && brightness > 0.0 ? density * brightness : density;
}

// The key light where lights are chosen by the table alone.
KeyLight key_of_table() {
    KeyLight key = KeyLight(NONE, 0.0, 0.0);
    for (uint i = 0u; i < push.constants.light_count; i++) {
        uint kind = Light_kind(lights, i);
        if (is_triangle_light(kind) || kind == LIGHT_SPHERE) break;
        if (is_delta_light(kind)) consider(key, i, Light_probability(lights, i));
    }
    key.rival = 0.0; // each is chosen as often everywhere, so that none takes its place elsewhere
    return key;
}

// Samples one light for a receiver. The radiance is 0 when the light cannot reach the point.
LightSample light_sample(Receiver r, uint word, vec2 u) {
    vec3 p = r.position;
    LightSample s = LightSample(vec3(0.0, 0.0, 1.0), 0.0, vec3(0.0), 0.0, 0.0, 0u, NONE, 0.0);
    KeyLight key = KeyLight(NONE, 0.0, 0.0);
    uint count = push.constants.light_count, index = 0u, rest = word;
    float probability = 0.0;
    if (FX_LIGHT_TREE) index = choose_light(r, rest, probability, key);
    else if (count != 1u) index = alias_choose(AliasEntry_load(light_table, alias_slot(count, word)), count, rest);
    Light light = Light_load(lights, index);
    if (FX_LIGHT_TREE && probability > 0.0) light.probability = probability;
    if (FX_SOFT && !FX_LIGHT_TREE && !FX_WEIGHED_LIGHTS) key = key_of_table();
    if (FX_WEIGHED_LIGHTS && (FX_SOFT || is_delta_light(light.kind))) {
        uint weighed_index;
        Light weighed = choose_by_share(r, u.x, weighed_index, key);
        if (is_delta_light(light.kind)) {
            light = weighed;
            index = weighed_index;
        }
    }
    if (FX_EMISSIVE && is_triangle_light(light.kind)) {
        sample_triangle_light(p, light, u, s);
    } else if (FX_EMISSIVE && is_sphere_light(light.kind)) {
        sample_sphere_light(p, light, u, s);
    } else if ((FX_POINT && light.kind == LIGHT_POINT) || (FX_SPOT && light.kind == LIGHT_SPOT)) {
        vec3 to_light = light.a - p;
        float d2 = max(dot(to_light, to_light), 1e-30);
        s.distance = sqrt(d2);
        s.direction = to_light / s.distance;
        s.radiance = light.value / (d2 * light.probability);
        s.sharp = light.probability;
        if (FX_SPOT && light.kind == LIGHT_SPOT) s.radiance *= spot_share(light, s.direction);
    } else if (is_directional(light.kind)) {
        s.direction = -light.b;
        s.distance = INFINITE_DISTANCE;
        s.radiance = light.value / light.probability;
        s.sharp = light.probability;
    } else if (FX_ENVIRONMENT && light.kind == LIGHT_ENVIRONMENT) {
        sample_environment(index, light.probability, rest, u, s);
    }
    if (FX_LIGHT_TREE && FX_EMISSIVE && s.pdf > 0.0 && (is_triangle_light(light.kind) || is_sphere_light(light.kind))) {
        float density = lamp_density(light.material, FX_TEXTURES ? Shading_brightness(shading, light.triangle) : 0.0);
        s.pdf = nominal_pdf(density, light.probability / s.pdf, p);
    }
    s.chosen = FX_LIGHT_TREE && probability == 0.0 ? NONE : index;
    s.kept = FX_SOFT ? kept_share(key) : 0.0;
    s.key = s.kept > 0.0 ? key.index : NONE;
    if (FX_LIGHT_TREE && probability == 0.0) s.radiance = vec3(0.0);
    return s;
}

// Density per solid angle with which light_sample would choose, from `origin`, the point of an emissive triangle or sphere that a ray hits
// at `t` under `cosine`, if lights were chosen by the table. `density` is that over area.
float table_pdf(float density, Surface s, vec3 origin, float t, float cosine) {
    if (FX_SPHERES && s.radius > 0.0) {
        float cap = sphere_cap(s.corner - origin, s.radius);
        return cap > 0.0 ? density * 2.0 * s.radius * s.radius / cap : 0.0; // times the area, over 2 pi times the cap
    }
    if (FX_LARGE_LAMPS) {
        float doubled_area;
        unit_vector(cross(s.e1, s.e2), doubled_area);
        SphericalTriangle seen = spherical_triangle(s.corner - origin, s.e1, s.e2);
        if (by_solid_angle(seen)) return density * 0.5 * doubled_area / seen.solid_angle;
    }
    return density * t * t / max(cosine, 1e-20);
}

// The same, however lights are chosen; with a tree the nominal one.
float triangle_light_pdf(Surface s, vec3 origin, float t, float cosine) {
    float density = lamp_density(s.material, s.brightness);
    float pdf = table_pdf(density, s, origin, t, cosine);
    if (!FX_LIGHT_TREE || pdf <= 0.0) return pdf;
    float doubled_area;
    unit_vector(cross(s.e1, s.e2), doubled_area);
    float area = FX_SPHERES && s.radius > 0.0 ? 4.0 * PI * s.radius * s.radius : 0.5 * doubled_area;
    return nominal_pdf(density, density * area / pdf, origin);
}
