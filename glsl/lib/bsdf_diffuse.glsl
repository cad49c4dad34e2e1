// Lambertian reflection: src/material/diffuse.rs.
#ifndef LIB_BSDF_DIFFUSE_GLSL
#define LIB_BSDF_DIFFUSE_GLSL

#include "lib/bsdf.glsl"

// Its paths can be shared with neighbouring pixels, lib/reuse.glsl.
#define BSDF_IS_LAMBERTIAN

struct Bsdf {
    vec3 albedo;
};

Bsdf bsdf_make(MaterialRecord material, vec3 color) {
    return Bsdf(color);
}

bool bsdf_is_delta(Bsdf b) {
    return false;
}

vec4 bsdf_eval_pdf(Bsdf b, vec3 wo, vec3 wi) {
    return min(wo.z, wi.z) >= MIN_COSINE ? INV_PI * vec4(b.albedo, wi.z) : vec4(0.0);
}

BsdfSample bsdf_sample(Bsdf b, vec3 wo, vec3 u) {
    vec3 wi = sample_cosine_hemisphere(u.xy);
    bool above = min(wo.z, wi.z) >= MIN_COSINE;
    return BsdfSample(wi, above ? wi.z * INV_PI : 0.0, b.albedo, false);
}

#endif
