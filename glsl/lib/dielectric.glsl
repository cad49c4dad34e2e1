// Reflection and refraction at the boundary of a transparent solid, rough or smooth: src/material/dielectric.rs.
#ifndef LIB_DIELECTRIC_GLSL
#define LIB_DIELECTRIC_GLSL

#include "lib/bsdf.glsl"
#include "lib/fresnel.glsl"
#include "lib/ggx.glsl"

// η seen from the side of wo, and η² - 1.
vec2 dielectric_index(float ior, bool from_outside) {
    float excess = (ior - 1.0) * (ior + 1.0);
    return from_outside ? vec2(ior, excess) : vec2(1.0 / ior, -excess / (ior * ior));
}

// f and pdf; alpha > 0.
vec4 dielectric_eval_pdf(float ior, float alpha, vec3 wo, vec3 wi) {
    float zo = abs(wo.z);
    float zi = abs(wi.z);
    if (min(zo, zi) < MIN_COSINE) return vec4(0.0);
    vec2 index = dielectric_index(ior, wo.z > 0.0);
    bool is_reflection = wo.z * wi.z > 0.0;
    vec3 h = wo + (is_reflection ? 1.0 : index.x) * wi;
    float h2 = dot(h, h);
    float oh = dot(wo, h);
    float ih = dot(wi, h);
    // A facet shows wo its front and, in refraction, wi its back.
    float facing = h.z * wo.z;
    if (!is_reflection && !(oh * facing > 0.0 && ih * facing < 0.0)) return vec4(0.0);
    float cosine = is_reflection ? 0.5 * sqrt(h2) : abs(oh) * inversesqrt(h2);
    vec2 fresnel = fresnel_dielectric(min(cosine, 1.0), index.y);
    float spread = is_reflection ? 0.5 * fresnel.x : 2.0 * fresnel.y * abs(oh * ih) / (h2 * h2);
    vec2 rough = vec2(alpha);
    float facets = spread * ggx_distribution(h, rough);
    float so = ggx_stretch(wo, rough);
    float si = ggx_stretch(wi, rough);
    float f = facets / (zo * si + zi * so);
    float pdf = facets / (zo + so) * (is_reflection ? 1.0 : 1.0 + index.y);
    return vec4(vec3(f), pdf);
}

BsdfSample dielectric_sample(float ior, float alpha, vec3 wo, vec3 u) {
    float zo = abs(wo.z);
    if (zo < MIN_COSINE) return bsdf_no_sample();
    vec2 index = dielectric_index(ior, wo.z > 0.0);
    float excess = index.y;
    vec3 upper = vec3(wo.xy, zo);
    vec2 rough = vec2(alpha);
    bool is_delta = alpha == 0.0;
    vec3 m = is_delta ? vec3(0.0, 0.0, 1.0) : ggx_sample(upper, rough, u.xy);
    float cosine = clamp(dot(upper, m), 0.0, 1.0);
    float refracted = fresnel_refracted(cosine, excess);
    vec2 fresnel = fresnel_dielectric(cosine, refracted, excess);
    bool is_reflection = u.z < fresnel.x;
    // Snell's law in the form (η² - 1) / (cos θ + η cos θt) = η cos θt - cos θ.
    float bend = excess / (cosine + refracted);
    vec3 wi = is_reflection ? 2.0 * cosine * m - upper : -(upper + bend * m);
    wi = normalize(wi);
    float zi = is_reflection ? wi.z : -wi.z;
    if (zi < MIN_COSINE) return bsdf_no_sample();
    float pdf = is_reflection ? fresnel.x : fresnel.y;
    float weight = is_reflection ? 1.0 : 1.0 / (1.0 + excess);
    if (!is_delta) {
        float so = ggx_stretch(wo, rough);
        float si = ggx_stretch(wi, rough);
        float facets = ggx_distribution(m, rough) / (zo + so);
        pdf *= facets * (is_reflection ? 0.5 : 2.0 * cosine * refracted * index.x / (bend * bend));
        weight *= zi * (zo + so) / (zo * si + zi * so);
    }
    wi.z *= wo.z < 0.0 ? -1.0 : 1.0;
    return BsdfSample(wi, pdf, vec3(weight), is_delta);
}

#endif
