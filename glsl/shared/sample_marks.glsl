// Marks of a sample that tell what its path did not see. Smooth surfaces sent it a way that few take: its albedo is not that of what the
// pixel shows.
const uint ASTRAY = 1u;
// It chose another light than the key light (see shared/light.glsl): it tells nothing of the light that is kept apart.
const uint PASSED_OVER = 2u;

// Bits of PixelLight.remainder: all samples of a pixel have that mark.
const uint ALL_ASTRAY = 0x80000000u, ALL_PASSED_OVER = 0x40000000u;
// A sample of it showed nothing that reflects, as the sky or a lamp.
const uint SOME_BARE = 0x20000000u;
