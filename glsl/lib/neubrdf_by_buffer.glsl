// NeuBRDFs in a plain storage buffer: the material alone, for other tracers. It needs GLSL 4.50, and the file that
// `neubrdf export --shader glsl` writes is this one with all that it includes.
//
//     vec3 neubrdf_eval(uint model, vec3 wo, vec3 wi)              f in 1/sr, RGB, without the cosine; 0 if either is below the surface;
//                                                                  of a material that varies over a texture, its average
//     float neubrdf_pdf(uint model, vec3 wo, vec3 wi)              per unit solid angle, of neubrdf_sample
//     NeuBrdfSample neubrdf_sample(uint model, vec3 wo, vec3 u)    u in [0, 1)³: two numbers for the direction, one that picks a lobe
//
// `model` is the first word of a model in the buffer, a multiple of four. Directions are unit vectors that point away from the
// surface, x along the tangent and z along the normal. The buffer is what `export` writes, as it is; bind it read-only at
// NEUBRDF_SET and NEUBRDF_BINDING.
#ifndef LIB_NEUBRDF_BY_BUFFER_GLSL
#define LIB_NEUBRDF_BY_BUFFER_GLSL

#include "layout/neubrdf.glsl"
#include "lib/lobes.glsl"

#ifndef NEUBRDF_SET
#define NEUBRDF_SET 0
#endif
#ifndef NEUBRDF_BINDING
#define NEUBRDF_BINDING 0
#endif

layout(std430, set = NEUBRDF_SET, binding = NEUBRDF_BINDING) readonly buffer NeuBrdfModels {
    uint words[];
} neubrdf_models;

// A model begins with its lobes; this is the first word behind them.
struct NeuBrdfTable {
    uint first;
};

uint neubrdf_word(NeuBrdfTable table, uint index) {
    return neubrdf_models.words[table.first + index];
}

vec4 neubrdf_numbers(NeuBrdfTable table, uint group) {
    uint at = table.first + (NEUBRDF_HALF ? 2u : 4u) * group;
    uvec2 low = uvec2(neubrdf_models.words[at], neubrdf_models.words[at + 1u]);
    if (NEUBRDF_HALF) {
        return vec4(unpackHalf2x16(low.x), unpackHalf2x16(low.y));
    }
    uvec2 high = uvec2(neubrdf_models.words[at + 2u], neubrdf_models.words[at + 3u]);
    return uintBitsToFloat(uvec4(low, high));
}

NeuBrdfHeader neubrdf_header(NeuBrdfTable table) {
    return NeuBrdfHeader(
        SphereTableRecord(neubrdf_word(table, 0u), neubrdf_word(table, 1u), neubrdf_word(table, 2u), neubrdf_word(table, 3u)),
        SphereTableRecord(neubrdf_word(table, 4u), neubrdf_word(table, 5u), neubrdf_word(table, 6u), neubrdf_word(table, 7u)),
        neubrdf_word(table, 8u), neubrdf_word(table, 9u), neubrdf_word(table, 10u),
        uintBitsToFloat(neubrdf_word(table, 11u)), uintBitsToFloat(neubrdf_word(table, 12u)), uintBitsToFloat(neubrdf_word(table, 13u)),
        neubrdf_word(table, 14u), neubrdf_word(table, 15u));
}

struct NeuBrdfRun {
    NeuBrdfTable table;
    uint first;
};

NeuBrdfRun neubrdf_run(NeuBrdfTable table, uint first) {
    return NeuBrdfRun(table, first);
}

vec4 neubrdf_next(NeuBrdfRun run, uint place) {
    return neubrdf_numbers(run.table, run.first + place);
}

#define NEUBRDF_DIRECTIONS 1

#include "lib/neubrdf.glsl"

struct NeuBrdfSample {
    vec3 wi;
    float pdf;    // 0: no direction
};

vec2 neubrdf_lobe_pair(uint model, uint pair) {
    return uintBitsToFloat(uvec2(neubrdf_models.words[model + 2u * pair], neubrdf_models.words[model + 2u * pair + 1u]));
}

Lobes neubrdf_lobes(uint model, float cosine) {
    LobePlace place = lobe_place(cosine);
    vec4 alpha = vec4(neubrdf_lobe_pair(model, 0u), neubrdf_lobe_pair(model, 1u));
    return Lobes(alpha, mix(neubrdf_lobe_pair(model, place.pair), neubrdf_lobe_pair(model, place.pair + 1u), place.fraction));
}

vec3 neubrdf_eval(const uint model, const vec3 wo, const vec3 wi) {
    if (!both_above(wo, wi)) return vec3(0.0);
    vec3 f[NEUBRDF_DIRECTIONS];
    neubrdf_values(NeuBrdfTable(model + LOBE_BYTES / 4u), NEUBRDF_WHOLE, wo, vec3[NEUBRDF_DIRECTIONS](wi), f);
    return f[0];
}

float neubrdf_pdf(const uint model, const vec3 wo, const vec3 wi) {
    return lobes_pdf(neubrdf_lobes(model, wo.z), wo, wi, wo + wi);
}

NeuBrdfSample neubrdf_sample(const uint model, const vec3 wo, const vec3 u) {
    vec4 picked = lobes_sample(neubrdf_lobes(model, wo.z), wo, u);
    return NeuBrdfSample(picked.xyz, picked.w);
}

#endif
