// A path traced as a whole, by the thread that begins it.
#include "shared/path_step.glsl"
#include "shared/trace.glsl"
#include "shared/deal.glsl"

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
        add_sampled(p, behind_walls(d.sampled), lit && !d.shadowed, d.sharp);
        going = d.alive && arrive(p, s);
    } while (any_lane(going));
}
