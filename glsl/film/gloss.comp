#include "shared/thread.glsl"
#include "shared/noisy.glsl"
#include "shared/albedo.glsl"
#include "shared/gloss_cell.glsl"

// Tells per cell how much of the light that is not direct does not follow albedo, as what a gloss mirrors: divided by albedo, filtered and multiplied by it
// again, it would show the texture below the gloss. Differences of light between pixels LAG apart around the middle of a cell, which show
// its material, are fitted by d times those of albedo, both relative to their means, with least squares and one d for all channels: what
// changes slowly has small ones. The share 1 - d does not follow, of which counts what is beyond two standard errors. One thread takes
// one cell. Twin: denoise::twin::gloss.
layout(local_size_x = 64) in;
layout(scalar, binding = 3) writeonly buffer Cells { vec4 cells[]; }; // mean albedo, share of light that does not follow it
layout(scalar, push_constant) uniform Push { SizePush push; };

const int REACH = 12; // pixels from the middle of the window to its border
const float FEWEST = 200.0; // differences: of fewer, what they have in common by chance counts
const float LEAST_SPREAD = 0.01; // of albedo, relative to its mean: below, nothing is told by how light follows it
const float ERRORS = 2.0; // standard errors that count as none
const int LAG = 2; // pixels: textures are finer than most changes of light

// Sums over pixels, and over pairs of them.
struct Sums {
    float count, pairs;
    vec3 albedo, light; // over pixels
    vec3 albedo2, light2, together; // of differences over pairs
};

vec3 light_at(int i) { return colour_at(i) - PixelLight_direct(light, i); }

vec3 positive_albedo_at(int i) { return max(number(albedo_at(i)), vec3(0.0)); }

// Whether pixel `q` tells of the material that the middle shows.
bool matches(int q, int middle) { return tells_albedo(q) && connected(q, middle) && one_material(albedo_at(q), albedo_at(middle)); }

Sums sums_around(int middle) {
    ivec2 size = ivec2(push.size), at = ivec2(middle % size.x, middle / size.x);
    Sums s = Sums(0.0, 0.0, vec3(0.0), vec3(0.0), vec3(0.0), vec3(0.0), vec3(0.0));
    ivec2 from = max(at - REACH, ivec2(0)), to = min(at + REACH, size - 1);
    for (int y = from.y; y <= to.y; y++) {
        for (int x = from.x; x <= to.x; x++) {
            int q = y * size.x + x;
            if (!matches(q, middle)) continue;
            vec3 albedo = positive_albedo_at(q), l = light_at(q);
            s.count += 1.0;
            s.albedo += albedo;
            s.light += l;
            for (int k = 0; k < 2; k++) {
                ivec2 other = ivec2(x, y) + LAG * ivec2(1 - k, k);
                int o = other.y * size.x + other.x;
                if (any(greaterThan(other, to)) || !matches(o, middle) || !connected(o, q)) continue;
                vec3 da = albedo - positive_albedo_at(o), dl = l - light_at(o);
                s.pairs += 1.0;
                s.albedo2 += da * da;
                s.light2 += dl * dl;
                s.together += da * dl;
            }
        }
    }
    return s;
}

// The sum over the channels that are there.
float total(vec3 v, bvec3 there) { return dot(mix(vec3(0.0), v, there), vec3(1.0)); }

// The share of the light that does not follow albedo; 0 where nothing tells.
float unfollowed(Sums s) {
    float n = max(s.count, 1.0), pairs = max(s.pairs, 2.0);
    vec3 albedo = s.albedo / n, light = s.light / n;
    bvec3 there = bvec3(uvec3(greaterThan(albedo, vec3(SMALLEST_ALBEDO))) & uvec3(greaterThan(light, vec3(0.0))));
    float spread = total(s.albedo2 / (albedo * albedo), there), slope = total(s.together / (albedo * light), there) / spread;
    float rest = max(total(s.light2 / (light * light), there) - slope * slope * spread, 0.0);
    float share = 1.0 - slope - ERRORS * sqrt(rest / (pairs * spread));
    bool told = s.pairs >= FEWEST && spread > LEAST_SPREAD * LEAST_SPREAD * pairs * total(vec3(1.0), there);
    return told && finite(share) ? clamp(share, 0.0, 1.0) : 0.0;
}

void main() {
    int cell = int(thread_index());
    ivec2 grid = gloss_cells_of(push.size);
    if (cell >= grid.x * grid.y) return;
    Sums s = sums_around(middle_of(ivec2(cell % grid.x, cell / grid.x), push.size));
    cells[cell] = vec4(s.albedo / max(s.count, 1.0), unfollowed(s));
}
