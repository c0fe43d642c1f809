// The variance of a pixel's colour, per channel. Needs `variance`.
vec3 variance_at(int i) {
    return vec3(texelFetch(variance, 3 * i).x, texelFetch(variance, 3 * i + 1).x, texelFetch(variance, 3 * i + 2).x);
}
