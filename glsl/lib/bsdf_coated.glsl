// A diffuse base under a dielectric coat: src/material/coated.rs.
#ifndef LIB_BSDF_COATED_GLSL
#define LIB_BSDF_COATED_GLSL

#include "lib/bsdf.glsl"
#include "lib/fresnel.glsl"
#include "lib/ggx.glsl"

struct Bsdf {
    vec3 base;         // albedo
    float base_scale;  // 1 / (1 - average albedo of the coat)
    float excess;      // η² - 1 of the coat
    float alpha;       // of the coat; 0: smooth
    CoatTable coat;
};

Bsdf bsdf_make(MaterialRecord material, vec3 color) {
    float excess = (material.ior - 1.0) * (material.ior + 1.0);
    return Bsdf(color, material.base_scale, excess, material.alpha.x, material.coat);
}

bool bsdf_is_delta(Bsdf b) {
    return false;
}

// The share of light from this angle that the coat reflects.
float coat_albedo(Bsdf b, float cosine) {
    if (b.alpha == 0.0) return fresnel_dielectric(min(cosine, 1.0), b.excess);
    float position = sqrt(sqrt(clamp(cosine, 0.0, 1.0))) * float(COAT_TABLE_LENGTH - 1u);
    uint cell = min(uint(position), COAT_TABLE_LENGTH - 2u);
    return mix(b.coat.albedo[cell], b.coat.albedo[cell + 1u], position - float(cell));
}

// The probability of sampling the coat.
float coat_probability(Bsdf b, float coat) {
    float base = (1.0 - coat) * max(b.base.x, max(b.base.y, b.base.z));
    return coat > 0.0 ? coat / (coat + base) : 0.0;
}

vec4 bsdf_eval_pdf(Bsdf b, vec3 wo, vec3 wi) {
    if (min(wo.z, wi.z) < MIN_COSINE) return vec4(0.0);
    float coat = coat_albedo(b, wo.z);
    float through = (1.0 - coat) * (1.0 - coat_albedo(b, wi.z)) * b.base_scale * INV_PI;
    float probability = coat_probability(b, coat);
    vec4 value = vec4(b.base * through, (1.0 - probability) * wi.z * INV_PI);
    if (b.alpha > 0.0) {
        vec2 alpha = vec2(b.alpha);
        vec3 h = wo + wi;
        float so = ggx_stretch(wo, alpha);
        float si = ggx_stretch(wi, alpha);
        float d = 0.5 * ggx_distribution(h, alpha);
        float reflected = fresnel_dielectric(min(0.5 * length(h), 1.0), b.excess);
        value += vec4(vec3(reflected * d / (wo.z * si + wi.z * so)), probability * d / (wo.z + so));
    }
    return value;
}

BsdfSample bsdf_sample(Bsdf b, vec3 wo, vec3 u) {
    if (wo.z < MIN_COSINE) return bsdf_no_sample();
    float coat = coat_albedo(b, wo.z);
    float probability = coat_probability(b, coat);
    vec3 wi;
    if (u.z >= probability) {
        wi = sample_cosine_hemisphere(u.xy);
    } else if (b.alpha == 0.0) {
        return BsdfSample(vec3(-wo.xy, wo.z), probability, vec3(coat / probability), true);
    } else {
        vec3 m = ggx_sample(wo, vec2(b.alpha), u.xy);
        wi = normalize(2.0 * dot(wo, m) * m - wo);
    }
    vec4 value = bsdf_eval_pdf(b, wo, wi);
    if (!(value.a > 0.0)) return bsdf_no_sample();
    return BsdfSample(wi, value.a, value.rgb * (wi.z / value.a), false);
}

#endif
