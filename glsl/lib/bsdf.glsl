// What the families of materials have in common. Each has a number in layout/material.glsl, a file lib/bsdf_X.glsl, and kernels
// shade_X.comp and test_bsdf_X.comp that include it; on the host it is a `render::Family`. The file defines
//
//     struct Bsdf;                                           the material at the hit
//     Bsdf bsdf_make(MaterialRecord material, vec3 color);   color: the material's, times its texture
//     bool bsdf_is_delta(Bsdf b);                            all lobes are Dirac deltas: light sampling is useless
//     vec4 bsdf_eval_pdf(Bsdf b, vec3 wo, vec3 wi);          rgb: f without the cosine, a: pdf; Dirac lobes count as 0
//     BsdfSample bsdf_sample(Bsdf b, vec3 wo, vec3 u);       u.xy: direction, u.z: lobe
//
// One that varies over a texture otherwise than by a colour defines BSDF_HAS_PLACE and `void bsdf_look_at(inout Bsdf b, vec2 uv, float area)`;
// until that is called it is its average.
//
// BRDFs without a sampler of their own define but their values, and include lib/lobe.glsl, which does the rest.
//
// Directions are unit vectors in the local frame, both pointing away. The definitions are src/material's; here they
// are rearranged so that nothing cancels in f32, whatever the roughness.
#ifndef LIB_BSDF_GLSL
#define LIB_BSDF_GLSL

#include "layout/material.glsl"
#include "lib/hemisphere.glsl"

struct BsdfSample {
    vec3 wi;
    float pdf;      // per unit solid angle, or the probability of the lobe if is_delta; 0: no direction
    vec3 weight;    // f |cos θi| / pdf
    bool is_delta;
};

BsdfSample bsdf_no_sample() {
    return BsdfSample(vec3(0.0, 0.0, 1.0), 0.0, vec3(0.0), false);
}

#endif
