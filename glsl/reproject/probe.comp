#include "effects.glsl"
#include "shared/thread.glsl"
#include "shared/scene.glsl"
#include "shared/frame.glsl"
#include "shared/finite.glsl"
#include "shared/largest_channel.glsl"

// Traces one path per cell of the film twice, with the same random numbers: before the scene changes, and after it. A path starts
// at the point that a pixel's samples are of, which moves with its surface, and is seen from where the last frame's camera was. It
// differs where something that it meets has changed: the samples of the pixels around are then of another light. This stands for
// the gradient samples of Schied, Peters and Dachsbacher 2018 ("Gradient Estimation for Real-Time Adaptive Temporal Filtering"),
// who compare new samples with single old ones; statistics of old samples hold none.
layout(local_size_x_id = 100) in;
layout(binding = 11) uniform usamplerBuffer points; // of SurfacePoint
layout(binding = 12) uniform usamplerBuffer history; // of History
layout(binding = 13) uniform usamplerBuffer offered; // of uint
layout(scalar, binding = 16) uniform Previous { Camera previous; };
layout(scalar, binding = 17) buffer Probes { Probe probes[]; };
layout(scalar, binding = 18) writeonly buffer Changes { LightChange changes[]; };
layout(scalar, push_constant) uniform Push { ProbePush push; };

#include "shared/camera.glsl"
#include "shared/trace_path.glsl"
#include "shared/history.glsl"
#include "shared/probe_cell.glsl"

// Mean radiance of the 3x3 pixels of the last frame around one, those of the border repeated: that of a single pixel would let noise
// decide.
vec3 light_around(uint pixel, uvec2 film) {
    ivec2 size = ivec2(film), at = ivec2(pixel % film.x, pixel / film.x);
    vec3 sum = vec3(0.0);
    for (int k = 0; k < 9; k++) {
        ivec2 q = clamp(at + ivec2(k % 3 - 1, k / 3 - 1), ivec2(0), size - 1);
        sum += History_mean(history, uint(q.y * size.x + q.x));
    }
    return sum / 9.0;
}

bool hands_on(uint pixel) {
    uint word = texelFetch(offered, int(pixel)).x;
    return carried_of(word).count > 0u || (word != 0u && carried_of(History_resting(history, pixel)).count > 0u);
}

// One of the cell's pixels that hand on samples, the first from a random one on; NONE where none does.
uint chosen_pixel(uint cell) {
    uvec2 size = push.constants.size, cells = probe_cells_of(size);
    uvec2 corner = PROBE_CELL * uvec2(cell % cells.x, cell / cells.x);
    uint first = pcg(cell + pcg(push.constants.seed)), chosen = NONE;
    for (uint k = 0u; k < PROBE_CELL * PROBE_CELL && chosen == NONE; k++) {
        uint place = (first + k) % (PROBE_CELL * PROBE_CELL);
        uvec2 at = corner + uvec2(place % PROBE_CELL, place / PROBE_CELL);
        uint pixel = at.y * size.x + at.x;
        if (all(lessThan(at, size)) && hands_on(pixel)) chosen = pixel;
    }
    return chosen;
}

// Index of a cell's sample in the sequence that all cells share: such that those of any window of light_change.comp are spread
// evenly over lights and directions, or nearly so. Cells 27 apart have the same.
uint sample_of(uint cell) {
    uint across = probe_cells_of(push.constants.size).x, x = cell % across, y = cell / across, index = 0u;
    for (uint part = 9u; part > 0u; part /= 3u) index = 9u * index + 3u * (y / part % 3u) + x / part % 3u;
    return index;
}

// Radiance from a point towards the last frame's camera, by one path.
vec3 light_from(SurfacePoint at, uint index) {
    if (at.triangle == NONE) return vec3(0.0);
    vec3 off = surface_at(Hit(0.0, at.triangle, at.instance, at.weights.x, at.weights.y)).position - previous.position;
    float depth = length(off);
    PathState p = path_state(previous.position, off / max(depth, 1e-37), false, path_seed(0u, index));
    p.hit = Hit(depth, at.triangle, at.instance, at.weights.x, at.weights.y);
    trace_path(p, true, sampler_start(0u, index, push.constants.seed));
    SplitLight light = light_of(p);
    return light.direct + light.indirect;
}

// What a path has found, in units of the light around its pixel: beside bright parts of the film, dark ones tell of a change as well. Its
// own light is a tenth of the unit, so that no path counts for more than ten.
LightChange share_of_light(vec3 difference, float light, uint pixel) {
    float unit = max(0.9 * largest_channel(light_around(pixel, push.constants.size)) + 0.1 * light, 1e-30);
    vec3 sum = difference / unit;
    LightChange change = LightChange_zero();
    change.sum = sum;
    change.size = largest_channel(abs(sum));
    change.squares = change.size * change.size;
    change.light = light / unit;
    change.count = 1u;
    return change;
}

// The share of the light around a pixel that has come or gone without noise: where the shadow or the cone of a light without extent has
// moved across the path's first surface. None where another light was chosen.
float certain_change(vec3 before, uint choice, uint pixel) {
    if (certain_choice == NONE || certain_choice != choice) return 0.0;
    float change = largest_channel(abs(certain_light - before));
    float most = max(largest_channel(light_around(pixel, push.constants.size)), largest_channel(max(certain_light, before)));
    return finite(vec3(change)) ? change / max(most, 1e-30) : 0.0;
}

void main() {
    uint i = thread_index();
    if (i >= push.cells) return;
    bool after = push.after != 0u;
    Probe before = probes[i];
    uint pixel = after ? before.pixel : chosen_pixel(i), known = pixel == NONE ? 0u : pixel;
    SurfacePoint at = SurfacePoint_load(points, known);
    if (after) {
        at.triangle = History_triangle(history, known);
        at.instance = History_instance(history, known);
        at.weights = History_weights(history, known);
    }
    if (pixel == NONE) at.triangle = NONE;
    vec3 light = light_from(at, sample_of(i));
    if (!after) {
        probes[i].light = light;
        probes[i].certain = certain_light;
        probes[i].choice = certain_choice;
        probes[i].pixel = pixel;
        return;
    }
    vec3 difference = light - before.light;
    bool counts = pixel != NONE && finite(difference);
    changes[i] = counts ? share_of_light(difference, largest_channel(max(light, before.light)), known) : LightChange_zero();
    if (counts) changes[i].change = certain_change(before.certain, before.choice, known);
}
