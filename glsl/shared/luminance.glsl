// One number for a radiance.

const float ENOUGH = 4.0; // samples whose own variance is trusted
const float STRONGEST = 1e18; // differences are cut there, so that their squares are finite

float luminance(vec3 c) {
    return dot(c, vec3(0.2126, 0.7152, 0.0722)); // Rec. 709
}

float contrast(vec3 a, vec3 b) {
    return clamp(luminance(a) - luminance(b), -STRONGEST, STRONGEST);
}
