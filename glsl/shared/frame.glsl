// What all paths of a frame have in common. A uniform buffer, written in the order of commands: frames in flight keep theirs.
layout(scalar, binding = 15) uniform Frame { FrameConstants frame; };
