// Constants of a frame. The command buffer writes this uniform buffer, so that a later frame does not change an earlier one's.
layout(scalar, binding = 15) uniform Frame { FrameConstants frame; };
