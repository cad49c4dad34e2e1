// How a vertex looks for light: whether lights are sampled, and the density that its next direction is picked with. Any choice has
// the same expectation; they are here to be compared. The defaults cost nothing: drivers delete the rest.
#ifndef LIB_STRATEGY_GLSL
#define LIB_STRATEGY_GLSL

#include "lib/bsdf.glsl"
#include "lib/light.glsl"

layout(constant_id = 13) const bool LIGHT_SAMPLING = true;
layout(constant_id = 14) const uint BSDF_SAMPLING = 0u;   // of render::BsdfSampling: 0 the material's lobes, 1 cosine, 2 uniform

const bool SAMPLES_LIGHTS = HAS_LIGHTS && LIGHT_SAMPLING;

// Whether directions come from the hemisphere, not from the material. Materials with Dirac lobes keep their own sampler.
bool strategy_takes_hemisphere(bool has_dirac_lobe) {
    return BSDF_SAMPLING != 0u && !has_dirac_lobe;
}

// The density of wi; `both_sides`: over the sphere, each half of it alike.
float strategy_pdf(vec3 wi, bool both_sides) {
    float cosine = both_sides ? abs(wi.z) : wi.z;
    float density = BSDF_SAMPLING == 1u ? cosine * INV_PI : 0.5 * INV_PI;
    return cosine >= MIN_COSINE ? (both_sides ? 0.5 : 1.0) * density : 0.0;
}

// A direction and its density, 0 where there is none.
vec4 strategy_pick(vec3 u, bool both_sides) {
    vec3 wi = BSDF_SAMPLING == 1u ? sample_cosine_hemisphere(u.xy)
                                  : vec3(sqrt(u.x * (2.0 - u.x)) * unit_circle(u.y), 1.0 - u.x);
    wi.z *= both_sides && u.z < 0.5 ? -1.0 : 1.0;
    return vec4(wi, strategy_pdf(wi, both_sides));
}

#endif
