// A path traced as a whole, by the thread that begins it.
#include "shared/path_step.glsl"
#include "shared/trace.glsl"
#include "shared/deal.glsl"

// What the light that is chosen at the first surface that is not smooth brings there, times the probability of that choice, if it has no
// extent: without noise, as long as the choice is the same. Paths that had the choice between two ways there tell of none.
vec3 certain_light = vec3(0.0);
uint certain_choice = NONE;

// Follows a path that has come to its first hit to its end. One that is not `on` keeps others company where triangles are dealt.
void trace_path(inout PathState p, bool on, Sampler random) {
    Surface s;
    // A turn of the loop leads from one surface to the next.
    bool going = arrive(p, s) && on;
    if (any_lane(going)) do {
        uvec2 from = uvec2(p.hit.triangle, p.hit.instance);
        Departure d = leave(p, s, going, random);
        if (!DEALT && !d.alive && !d.shadowed) break;
        bool lit = d.shadowed;
        Segment next = next_segment(p);
        if (DEALT) p.hit = deal_shadow_then_closest(d.shadow, d.shadowed, next, d.alive, push.constants.root, from);
        else p.hit = trace_shadow_then_closest(d.shadow, d.shadowed, next, d.alive, push.constants.root, from);
        vec3 sampled = behind_walls(d.sampled);
        add_sampled(p, d, sampled, lit && !d.shadowed);
        if (p.scattered == 1u && certain_choice == NONE && p.share == 1.0 && push.constants.light_count > 0u) {
            certain_choice = d.chosen;
            certain_light = lit && !d.shadowed ? d.certainty * sampled : vec3(0.0);
        }
        going = d.alive && arrive(p, s);
    } while (any_lane(going));
}
