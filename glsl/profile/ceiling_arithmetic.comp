#include "shared/thread.glsl"

// Multiplies and adds in registers, to measure how fast a kernel can compute. Twelve values do not depend on each other, so that
// one operation need not wait for the one before; a processor with sixteen registers holds them all.
layout(local_size_x_id = 100) in;
layout(scalar, binding = 0) writeonly buffer Result { vec4 result[]; };
layout(scalar, push_constant) uniform Push { uint push; }; // threads

const uint TURNS = 4096u;      // of the loop
const uint OPERATIONS = 96u;   // of a turn and thread: a multiplication and an addition of 12 values, four times
const float FACTOR = 0.75;
const float ADDEND = 0.0625;   // values approach ADDEND / (1 - FACTOR), so that none grows

void main() {
    uint i = thread_index();
    if (i >= push) return;
    vec4 a = vec4(float(i & 1023u)), b = a + 1.0, c = a + 2.0;
    for (uint turn = 0u; turn < TURNS; turn++) {
        [[unroll]] for (int k = 0; k < 4; k++) {
            a = a * FACTOR + ADDEND;
            b = b * FACTOR + ADDEND;
            c = c * FACTOR + ADDEND;
        }
    }
    result[i] = a + b + c;
}
