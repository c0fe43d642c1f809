// Inputs that `auto` makes for its candidates, and corrections of their results. Twin: src/denoise/filter/auto/reference.rs.
const float BRIGHT = 5.0; // luminance over that of the surroundings, above which a pixel is dimmed

// The part of a pixel's light that the narrow window filters; the wide one spreads the rest. Where samples are few, a few bright
// ones carry much of the light, and would become blots in narrow windows.
vec3 dimmed(vec3 colour, vec3 around) {
    float bright = luminance(colour), most = BRIGHT * max(luminance(around), 0.0);
    return bright > most ? colour * (most / bright) : colour;
}

// Cuts negative light, which linear fits produce, to 0; or, in images that have negative values, to the wide window's result.
vec3 as_light(vec3 fitted, vec3 wide) {
    return max(fitted, min(wide, vec3(0.0)));
}

// The narrow window's result, with the light that was dimmed as the wide one spreads it.
vec3 whole_light(vec3 narrow, vec3 wide, vec3 wide_dim) {
    return as_light(narrow + (wide - wide_dim), wide);
}

// Instead of the variance that comes with the blend.
const float UNMEASURED = -1.0, UNFILTERED = -2.0;
