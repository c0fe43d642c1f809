// Exact unpolarised Fresnel reflectance.

// Returns x: the reflectance of a dielectric at cosine `c` >= 0, `eta` = index beyond / index on this side; y: the cosine of
// the refracted ray, 0 under total reflection. With g = eta cos_t both amplitudes need one root. The lower limit of `c`
// prevents 0 / 0 at grazing incidence and eta = 1.
vec2 fresnel_dielectric(float c, float eta) {
    c = max(c, 1e-10);
    float g2 = (eta - 1.0) * (eta + 1.0) + c * c;
    float g = sqrt(max(g2, 0.0));
    float e = eta * eta;
    float rs = (c - g) / (c + g);
    float rp = (e * c - g) / (e * c + g);
    return g2 > 0.0 ? vec2(0.5 * (rs * rs + rp * rp), min(g / eta, 1.0)) : vec2(1.0, 0.0);
}

// Reflectance of a conductor per channel. Adding `c2` last makes it exactly 0 for eta = 1, k = 0. The lower limit of `p` prevents
// 0 / 0 head on for eta = k = 0, which reflects all.
vec3 fresnel_conductor(float c, vec3 eta, vec3 k) {
    c = clamp(c, 1e-8, 1.0);
    float c2 = c * c;
    float s2 = 1.0 - c2;
    vec3 t = (eta - 1.0) * (eta + 1.0) - k * k + c2;
    vec3 m = sqrt(t * t + 4.0 * eta * eta * k * k);       // a^2 + b^2 for a + ib = sqrt(eta_complex^2 - s2)
    vec3 ac = 2.0 * c * sqrt(max(0.5 * (m + t), 0.0));
    vec3 rs = (m + c2 - ac) / (m + c2 + ac);
    vec3 p = max(c2 * m + s2 * s2, 1e-30);
    vec3 rp = rs * (p - ac * s2) / (p + ac * s2);
    return 0.5 * (rs + rp);
}
