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

// The leverages of wide, middle and narrow windows and of svgf, as auto_leverage.comp writes the last two. Larger windows keep next to
// nothing: as much less than the narrow one as they are larger, by the `shares` of their pixels.
vec4 leverages_of(vec4 found, vec2 shares) {
    return vec4(shares * found.z, found.zw);
}

// An error counts the less, the noisier the surroundings are: in squared luminance plus so many times the variance. Without it
// the noise of bright reflections decided which candidate is taken around them (Veach's plates at 4 samples: relMSE 0.31
// instead of 0.02). Not the pixel's own variance, which few samples tell too small where they are dark by chance.
const float NOISE = 4.0;

// The optimism of an error estimate is the covariance of a pixel's noise with its filtered value (Efron 2004). Leverages tell it of linear
// filters. svgf's weights follow a pixel's own noise as well, so that pixels which are dark by chance get a result that is dark. That part
// grows with what noise has of all that is seen, up to this share of the noise where it drowns light. Without it svgf was taken for
// walls of rooms that few bright paths light, and made them as dark as most of their pixels.
const float OPTIMISM = 0.1;
float optimism_of(float noise) {
    float share = min(NOISE * noise, 1.0); // of the noise in what errors are divided by
    return OPTIMISM * share * share * noise;
}

// How much of the variance that samples tell may be noise, by the second differences of a surface. They are known by chance too.
const float TRUST = 1.25;
const float LEAST_SHARE = 0.02;
float share_of_noise(vec4 found) {
    return found.y > 0.0 ? clamp(TRUST * found.x / found.y, LEAST_SHARE, 1.0) : 1.0;
}

const float UNFILTERED = -2.0; // stands where the variance of a pixel would, if no candidate could fill it
