// Whether a lens blurs what a pixel shows: its guide is a mean over several points then, none of whose materials is named; nor is that of
// what was not hit. Needs `guide`.
bool blurred(int i) { return Guide_material(guide, i) == NONE; }
