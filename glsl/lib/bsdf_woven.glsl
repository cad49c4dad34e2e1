// Cloth of two crossed families of yarns: src/material/woven.rs, which has the formula.
#ifndef LIB_BSDF_WOVEN_GLSL
#define LIB_BSDF_WOVEN_GLSL

#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_EXT_scalar_block_layout : require

#include "lib/bsdf.glsl"
#include "lib/fresnel.glsl"
#include "lib/lobe_table.glsl"

// Written by src/render/brdf_table.rs.
struct YarnRecord {
    vec3 f0;
    float gloss;              // times coverage / π
    vec3 albedo;              // times (1 - gloss) coverage / π
    float isotropy;
    float specular_width;
    float volume_width;
};

// Warp and weft.
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer WovenTable {
    YarnRecord at[];
};

struct Brdf {
    uvec2 table;    // a WovenTable
};

Brdf brdf_make(MaterialRecord material) {
    return Brdf(lobe_brdf_data(material));
}

float normal_density(float x, float deviation) {
    float t = x / deviation;
    return exp(-0.5 * t * t) * (0.3989422804 / deviation);
}

// A family along x. `cosine` is that of half the angle between the directions.
vec3 yarn_eval(YarnRecord yarn, vec3 wo, vec3 wi, float cosine) {
    vec2 outward = normalize(wo.yz);
    vec2 inward = normalize(wi.yz);
    float masking = 0.5 * (outward.y * inward.y + min(outward.y, inward.y));
    float sine = 0.5 * (wo.x + wi.x);
    float mirrored = masking * 0.5 * length(outward + inward) * normal_density(sine, yarn.specular_width);
    float scattered = mix(masking * normal_density(sine, yarn.volume_width), 1.0, yarn.isotropy);
    return yarn.gloss * mirrored * fresnel_schlick(cosine, yarn.f0) + scattered * yarn.albedo;
}

#define BRDF_EVAL_ONE
vec3 brdf_eval(Brdf b, vec3 wo, vec3 wi) {
    WovenTable table = WovenTable(b.table);
    float cosine = min(0.5 * length(wo + wi), 1.0);
    return yarn_eval(table.at[0], wo, wi, cosine)
        + yarn_eval(table.at[1], vec3(wo.y, -wo.x, wo.z), vec3(wi.y, -wi.x, wi.z), cosine);
}

#include "lib/lobe.glsl"

#endif
