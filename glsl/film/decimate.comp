#include "shared/thread.glsl"

// Takes the pixels whose light was traced out of a sparse image, one per thread: those whose column and row are multiples of the
// stride. They make an image of their own, which filters take as any other. Twin: denoise::sparse::decimated.
layout(local_size_x = 64) in;
layout(binding = 0) uniform samplerBuffer radiance; // of vec4
layout(binding = 1) uniform usamplerBuffer guide; // of Guide
layout(binding = 2) uniform samplerBuffer variance; // of vec3
layout(scalar, binding = 3) writeonly buffer Radiance { vec4 traced_radiance[]; };
layout(scalar, binding = 4) writeonly buffer Guides { Guide traced_guide[]; };
layout(scalar, binding = 5) writeonly buffer Variance { vec3 traced_variance[]; };
layout(constant_id = 110) const bool MEASURED = true; // `variance` holds every pixel's
layout(scalar, push_constant) uniform Push { SparsePush push; };

#include "shared/sampled_albedo.glsl"
#include "shared/variance_at.glsl"

void main() {
    uint i = thread_index(), width = (push.size.x + push.stride - 1u) / push.stride;
    if (i >= width * ((push.size.y + push.stride - 1u) / push.stride)) return;
    uint whole = i / width * push.stride * push.size.x + i % width * push.stride;
    vec4 c = texelFetch(radiance, int(whole));
    traced_radiance[i] = c;
    Guide hit = Guide_load(guide, whole);
    hit.albedo = sampled_albedo(int(whole), c.w, hit.albedo);
    traced_guide[i] = hit;
    if (MEASURED) traced_variance[i] = variance_at(int(whole));
}
