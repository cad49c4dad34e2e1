// BRDFs without a sampler of their own, by one-sample MIS of the lobes of lib/lobes.glsl: src/material/lobe_sampled.rs. Included at the
// end of a family's lib/bsdf_X.glsl, behind
//
//     struct Brdf;                               what the BRDF is evaluated from; uvec2 in place of buffer references
//     Brdf brdf_make(MaterialRecord material);   its own data are at lobe_brdf_data(material), written by src/render/brdf_table.rs
//     void brdf_eval_pair(Brdf b, vec3 wo, vec3 wi_1, vec3 wi_2, out vec3 f_1, out vec3 f_2);
//
// f(wo, wi) without the cosine, finite and not negative, for two wi; z >= MIN_COSINE for all three. A family that gains nothing from
// two at once defines the macro BRDF_EVAL_ONE and `vec3 brdf_eval(Brdf b, vec3 wo, vec3 wi)` instead of the pair.
//
// This file defines all that lib/bsdf.glsl asks of a family, and BSDF_PICKS_FIRST with `bsdf_pick`, `bsdf_eval_pair` and `bsdf_picked`
// for the passes: a vertex picks its next direction, which is cheap, and then evaluates the light's and its own together.
#ifndef LIB_LOBE_GLSL
#define LIB_LOBE_GLSL

#include "lib/bsdf.glsl"
#include "lib/lobe_table.glsl"
#include "lib/lobes.glsl"

#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_EXT_scalar_block_layout : require

#define BSDF_PICKS_FIRST

struct Bsdf {
    vec4 alpha;    // of the two lobes
    uvec2 table;
    Brdf brdf;
};

// See lib/lobes.glsl.
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer LobeTable {
    vec2 at[];
};

#ifdef BRDF_EVAL_ONE
void brdf_eval_pair(Brdf b, vec3 wo, vec3 wi_1, vec3 wi_2, out vec3 f_1, out vec3 f_2) {
    f_1 = brdf_eval(b, wo, wi_1);
    f_2 = brdf_eval(b, wo, wi_2);
}
#endif

Bsdf bsdf_make(MaterialRecord material, vec3 color) {
    LobeTable table = LobeTable(material.table);
    return Bsdf(vec4(table.at[0], table.at[1]), material.table, brdf_make(material));
}

bool bsdf_is_delta(Bsdf b) {
    return false;
}

Lobes bsdf_lobes(Bsdf b, float cosine) {
    LobePlace place = lobe_place(cosine);
    LobeTable table = LobeTable(b.table);
    return Lobes(b.alpha, mix(table.at[place.pair], table.at[place.pair + 1u], place.fraction));
}

// A direction and its density, 0 where there is none.
vec4 bsdf_pick(Bsdf b, vec3 wo, vec3 u) {
    return lobes_sample(bsdf_lobes(b, wo.z), wo, u);
}

// f and pdf of the first direction; f of the second one, which bsdf_pick has picked.
void bsdf_eval_pair(Bsdf b, vec3 wo, vec3 wi, vec3 picked, out vec4 eval_pdf, out vec3 f_picked) {
    // Directions below the surface are replaced by one that is above it, so that no BRDF has to know them.
    const vec3 up = vec3(0.0, 0.0, 1.0);
    bool is_lit = both_above(wo, wi);
    bool is_picked = both_above(wo, picked);
    vec3 f;
    brdf_eval_pair(b.brdf, wo.z >= MIN_COSINE ? wo : up, is_lit ? wi : up, is_picked ? picked : up, f, f_picked);
    float pdf = lobes_pdf(bsdf_lobes(b, wo.z), wo, wi, wo + wi);
    eval_pdf = is_lit ? vec4(f, pdf) : vec4(0.0);
    f_picked = is_picked ? f_picked : vec3(0.0);
}

vec4 bsdf_eval_pdf(Bsdf b, vec3 wo, vec3 wi) {
    vec4 eval_pdf;
    vec3 unused;
    bsdf_eval_pair(b, wo, wi, wi, eval_pdf, unused);
    return eval_pdf;
}

// What picking `picked` amounts to, where f is `f`.
BsdfSample bsdf_picked(vec4 picked, vec3 f) {
    if (!(picked.w > 0.0)) return bsdf_no_sample();
    return BsdfSample(picked.xyz, picked.w, f * (picked.z / picked.w), false);
}

BsdfSample bsdf_sample(Bsdf b, vec3 wo, vec3 u) {
    vec4 picked = bsdf_pick(b, wo, u);
    return bsdf_picked(picked, bsdf_eval_pdf(b, wo, picked.xyz).rgb);
}

#endif
