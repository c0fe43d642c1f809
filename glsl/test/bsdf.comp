#include "effects.glsl"
layout(binding = 3) uniform usamplerBuffer texels; // of uint
#include "shared/bsdf.glsl"

// Calls the functions of shared/bsdf.glsl for one case per thread. Case i reads its Material and inputs[4 i ..] = wo, wi,
// (u_lobe, u), normal of the clear coat. It writes results[5 i ..] = bsdf_evaluate; sampled wi and success; weight and pdf; albedo and whether all lobes
// are deltas; bsdf_evaluate of the sampled wi.
layout(local_size_x = 64) in;
layout(scalar, binding = 0) readonly buffer Materials { Material materials[]; };
layout(scalar, binding = 1) readonly buffer Inputs { vec3 inputs[]; };
layout(scalar, binding = 2) writeonly buffer Results { vec4 results[]; };
layout(scalar, push_constant) uniform Push { TestPush push; };

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= push.count) return;
    Material m = materials[i];
    Bsdf b = Bsdf(m.kind, m.base_color, m.alpha, 1.0 + m.anisotropy, m.eta, m.k, m.specular, m.transmission, m.internal_fresnel, m.coat_table,
                  (m.flags & MATERIAL_NONLINEAR) != 0u, (m.flags & MATERIAL_GGX) != 0u,
                  metallic_layers(m.base_color, m.metallic, m.specular, m.specular_factor, m.transmission_factor, m.alpha,
                                  m.clearcoat, m.clearcoat_alpha, m.coat_table), 0.0, 0.0, 0.0);
    vec3 wo = inputs[4 * i];
    bsdf_view(b, wo);
    vec3 u = inputs[4 * i + 2];
    b.metallic.coat_normal = inputs[4 * i + 3];
    BsdfSample s;
    bool sampled = bsdf_sample(b, wo, u.x, u.yz, s);
    results[5 * i] = bsdf_evaluate(b, wo, inputs[4 * i + 1]);
    results[5 * i + 1] = vec4(s.wi, sampled ? 1.0 : 0.0);
    results[5 * i + 2] = vec4(s.weight, s.pdf);
    results[5 * i + 3] = vec4(bsdf_albedo(b, wo.z), bsdf_is_delta(b) ? 1.0 : 0.0);
    results[5 * i + 4] = bsdf_evaluate(b, wo, s.wi);
}
