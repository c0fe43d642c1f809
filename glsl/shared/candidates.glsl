// What auto makes of the image for its candidates, and of what they return. Twin: src/denoise/filter/auto/reference.rs.
const float BRIGHT = 5.0; // times the light around

// What the narrow window gets of a pixel. The wide one spreads the rest: a few bright samples, which carry much of the light
// where samples are few, would be blots in narrow windows.
vec3 dimmed(vec3 colour, vec3 around) {
    float bright = luminance(colour), most = BRIGHT * max(luminance(around), 0.0);
    return bright > most ? colour * (most / bright) : colour;
}

// Fits reach below what light can be; the wide one hardly does, and negative images are as they are.
vec3 as_light(vec3 fitted, vec3 wide) {
    return max(fitted, min(wide, vec3(0.0)));
}

// Both parts of the light together.
vec3 whole(vec3 narrow, vec3 wide, vec3 wide_dim) {
    return as_light(narrow + (wide - wide_dim), wide);
}
