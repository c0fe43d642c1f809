#include "shared/thread.glsl"
#include "shared/pcg.glsl"

// One sample or none for every pixel (Schalk 2018, algorithm 1): while there is a threshold, where the priority reaches it;
// then by chance, with the priority as the probability. Departure from the paper, where a priority must exceed the threshold:
// a pixel of which nothing is known has priority 1, which is the first threshold, and must get its sample.
layout(local_size_x_id = 100) in;
layout(binding = 0) uniform samplerBuffer priority; // of float
layout(scalar, binding = 1) writeonly buffer Counts { uint count[]; };
layout(scalar, push_constant) uniform Push { ChoosePush push; };

void main() {
    uint i = thread_index();
    if (i >= push.pixels) return;
    float p = texelFetch(priority, int(i)).x;
    // In integers, and so the same on every device: the product is exact.
    bool lucky = p >= 1.0 || pcg(pcg(i ^ pcg(push.seed)) + push.round) < (p > 0.0 ? uint(p * 4294967296.0) : 0u);
    count[i] = (push.threshold > 0.0 ? p >= push.threshold : lucky) ? 1u : 0u;
}
