// The boundary of a transparent solid: lib/dielectric.glsl.
#ifndef LIB_BSDF_DIELECTRIC_GLSL
#define LIB_BSDF_DIELECTRIC_GLSL

#include "lib/dielectric.glsl"

struct Bsdf {
    float ior;
    float alpha;
};

Bsdf bsdf_make(MaterialRecord material, vec3 color) {
    return Bsdf(material.ior, material.alpha.x);
}

bool bsdf_is_delta(Bsdf b) {
    return b.alpha == 0.0;
}

vec4 bsdf_eval_pdf(Bsdf b, vec3 wo, vec3 wi) {
    return bsdf_is_delta(b) ? vec4(0.0) : dielectric_eval_pdf(b.ior, b.alpha, wo, wi);
}

BsdfSample bsdf_sample(Bsdf b, vec3 wo, vec3 u) {
    return dielectric_sample(b.ior, b.alpha, wo, u);
}

#endif
