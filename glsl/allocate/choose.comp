#include "shared/thread.glsl"
#include "shared/pcg.glsl"

// Gives one pixel per thread one sample or none (Schalk 2018, algorithm 1). While there is a threshold, pixels whose priority
// reaches it get a sample; without one, the priority is the probability of a sample. As in the algorithm's listing, and not as its
// text says, a priority may equal the threshold: an unknown pixel has priority 1, which is the first threshold, and must get its sample.
layout(local_size_x_id = 100) in;
layout(binding = 0) uniform samplerBuffer priority; // of float
layout(scalar, binding = 1) writeonly buffer Counts { uint count[]; };
layout(scalar, push_constant) uniform Push { ChoosePush push; };

void main() {
    uint i = thread_index();
    if (i >= push.pixels) return;
    float p = texelFetch(priority, int(i)).x;
    // The comparison is in integers and the product is exact, so that every device decides alike.
    bool lucky = p >= 1.0 || pcg(pcg(i ^ pcg(push.seed)) + push.round) < (p > 0.0 ? uint(p * 4294967296.0) : 0u);
    count[i] = (push.threshold > 0.0 ? p >= push.threshold : lucky) ? 1u : 0u;
}
