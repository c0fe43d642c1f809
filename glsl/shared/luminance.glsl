// Luminance of linear Rec. 709 radiance, and differences of it.

const float ENOUGH = 2.0;     // from this number of samples on, their own variance is trusted
const float STRONGEST = 1e18; // differences are cut here, so that their squares are finite

float luminance(vec3 c) {
    return dot(c, vec3(0.2126, 0.7152, 0.0722));
}

float contrast(vec3 a, vec3 b) {
    return clamp(luminance(a) - luminance(b), -STRONGEST, STRONGEST);
}
