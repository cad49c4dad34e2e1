// NeuBRDFs that are read by buffer reference, up to two directions of light together.
//
// Every invocation of a subgroup evaluates the same model. CPU drivers do not know that a load is the same for all invocations: there
// each invocation loads other weights, and they are handed around.
#ifndef LIB_NEUBRDF_BY_ADDRESS_GLSL
#define LIB_NEUBRDF_BY_ADDRESS_GLSL

#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_shuffle : require

#include "layout/neubrdf.glsl"

// Of a subgroup, which share loads of weights and are all active; 1: each invocation loads for itself.
layout(constant_id = 25) const uint NEUBRDF_LANES = 1u;

layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer NeuBrdfHeaders { NeuBrdfHeader at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer NeuBrdfFloats { vec4 at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer NeuBrdfHalves { uvec2 at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer NeuBrdfWords { uint at[]; };

struct NeuBrdfTable {
    uvec2 address;
};

NeuBrdfHeader neubrdf_header(NeuBrdfTable table) {
    return NeuBrdfHeaders(table.address).at[0];
}

uint neubrdf_word(NeuBrdfTable table, uint index) {
    return NeuBrdfWords(table.address).at[index];
}

vec4 neubrdf_numbers(NeuBrdfTable table, uint group) {
    if (NEUBRDF_HALF) {
        uvec2 halves = NeuBrdfHalves(table.address).at[group];
        return vec4(unpackHalf2x16(halves.x), unpackHalf2x16(halves.y));
    }
    return NeuBrdfFloats(table.address).at[group];
}

// It may be read beyond its end. `address` is where an invocation's own share of what follows begins: a load is then at a distance from it that is
// known when the kernel is built, which spares CPU drivers three instructions of twice the width.
struct NeuBrdfRun {
    NeuBrdfTable table;
    uint first;
    uvec2 address;
    vec2 held;    // for one another
};

// Words of a group of four numbers.
const uint NEUBRDF_GROUP_WORDS = NEUBRDF_HALF ? 2u : 4u;

NeuBrdfRun neubrdf_run(NeuBrdfTable table, uint first) {
    uint bytes = 4u * (NEUBRDF_GROUP_WORDS * first + gl_SubgroupInvocationID % NEUBRDF_LANES);
    uint carry;
    uint low = uaddCarry(table.address.x, bytes, carry);
    return NeuBrdfRun(table, first, uvec2(low, table.address.y + carry), vec2(0.0));
}

// `place` is known when the kernel is built.
vec4 neubrdf_next(inout NeuBrdfRun run, uint place) {
    if (NEUBRDF_LANES == 1u) {
        return neubrdf_numbers(run.table, run.first + place);
    }
    uint lane = NEUBRDF_GROUP_WORDS * place % NEUBRDF_LANES;
    if (lane == 0u) {
        uint word = NeuBrdfWords(run.address).at[NEUBRDF_GROUP_WORDS * place];
        run.held = NEUBRDF_HALF ? unpackHalf2x16(word) : vec2(uintBitsToFloat(word));
    }
    if (NEUBRDF_HALF) {
        return vec4(subgroupShuffle(run.held, lane), subgroupShuffle(run.held, lane + 1u));
    }
    return vec4(subgroupShuffle(run.held.x, lane), subgroupShuffle(run.held.x, lane + 1u),
        subgroupShuffle(run.held.x, lane + 2u), subgroupShuffle(run.held.x, lane + 3u));
}

// 1: only the second direction is asked for.
layout(constant_id = 34) const uint NEUBRDF_DIRECTIONS = 2u;

#include "lib/neubrdf.glsl"

// f(wo, wi) as seen at a place, without the cosine, for directions above the surface. `table` is the same for all invocations of a subgroup.
void neubrdf_eval_pair(uvec2 table, NeuBrdfPlace place, vec3 wo, vec3 wi_1, vec3 wi_2, out vec3 f_1, out vec3 f_2) {
    vec3 wi[NEUBRDF_DIRECTIONS];
    vec3 f[NEUBRDF_DIRECTIONS];
    wi[0] = wi_1;
    wi[NEUBRDF_DIRECTIONS - 1u] = wi_2;
    neubrdf_values(NeuBrdfTable(table), place, wo, wi, f);
    f_1 = f[0];
    f_2 = f[NEUBRDF_DIRECTIONS - 1u];
}

#endif
