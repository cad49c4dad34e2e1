// Reflection by a metal, rough or mirror: src/material/conductor.rs.
#ifndef LIB_CONDUCTOR_GLSL
#define LIB_CONDUCTOR_GLSL

#include "lib/bsdf.glsl"
#include "lib/fresnel.glsl"
#include "lib/ggx.glsl"

struct Conductor {
    vec3 f0;
    vec3 eta;
    vec3 kappa;
    bool is_complex;
    vec2 alpha;    // 0: a mirror
};

vec3 conductor_fresnel(Conductor b, float cosine) {
    cosine = min(cosine, 1.0);
    if (b.is_complex) return fresnel_complex(cosine, b.eta, b.kappa);
    return fresnel_schlick(cosine, b.f0);
}

vec4 conductor_eval_pdf(Conductor b, vec3 wo, vec3 wi) {
    if (b.alpha.x == 0.0 || min(wo.z, wi.z) < MIN_COSINE) return vec4(0.0);
    vec3 h = wo + wi;
    float so = ggx_stretch(wo, b.alpha);
    float si = ggx_stretch(wi, b.alpha);
    float d = 0.5 * ggx_distribution(h, b.alpha);
    // wo·m is half the length of wo + wi.
    vec3 f = conductor_fresnel(b, 0.5 * length(h)) * (d / (wo.z * si + wi.z * so));
    return vec4(f, d / (wo.z + so));
}

BsdfSample conductor_sample(Conductor b, vec3 wo, vec3 u) {
    if (wo.z < MIN_COSINE) return bsdf_no_sample();
    if (b.alpha.x == 0.0) return BsdfSample(vec3(-wo.xy, wo.z), 1.0, conductor_fresnel(b, wo.z), true);
    vec3 m = ggx_sample(wo, b.alpha, u.xy);
    float cosine = dot(wo, m);
    vec3 wi = normalize(2.0 * cosine * m - wo);
    if (wi.z < MIN_COSINE) return bsdf_no_sample();
    float so = ggx_stretch(wo, b.alpha);
    float si = ggx_stretch(wi, b.alpha);
    float unshadowed = wi.z * (wo.z + so) / (wo.z * si + wi.z * so);
    float pdf = 0.5 * ggx_distribution(m, b.alpha) / (wo.z + so);
    return BsdfSample(wi, pdf, conductor_fresnel(b, max(cosine, 0.0)) * unshadowed, false);
}

#endif
