// A metal: lib/conductor.glsl.
#ifndef LIB_BSDF_CONDUCTOR_GLSL
#define LIB_BSDF_CONDUCTOR_GLSL

#include "lib/conductor.glsl"

#define Bsdf Conductor

Bsdf bsdf_make(MaterialRecord material, vec3 color) {
    bool is_complex = (material.flags & MATERIAL_COMPLEX_FRESNEL) != 0u;
    return Conductor(color, material.eta, material.kappa, is_complex, material.alpha);
}

bool bsdf_is_delta(Bsdf b) {
    return b.alpha.x == 0.0;
}

vec4 bsdf_eval_pdf(Bsdf b, vec3 wo, vec3 wi) {
    return conductor_eval_pdf(b, wo, wi);
}

BsdfSample bsdf_sample(Bsdf b, vec3 wo, vec3 u) {
    return conductor_sample(b, wo, u);
}

#endif
