// Queries that kernels answer which evaluate one BRDF: what tests and benches run.
#ifndef LAYOUT_EVALUATION
#define LAYOUT_EVALUATION

#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_EXT_scalar_block_layout : require

// Two directions of light, and a place, which a BRDF that does not vary ignores.
struct NeuBrdfQuery {
    vec3 wo;
    vec3 wi_1;
    vec3 wi_2;
    vec2 uv;
    float area;
};
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer NeuBrdfQueries { NeuBrdfQuery at[]; };

struct NeuBrdfValues {
    vec3 f_1;
    vec3 f_2;
};
layout(buffer_reference, scalar, buffer_reference_align = 4) writeonly buffer NeuBrdfResults { NeuBrdfValues at[]; };

layout(push_constant, scalar) uniform NeuBrdfPush {
    uvec2 table;    // a NeuBrdfTable or an NbrdfTable
    NeuBrdfQueries queries;
    NeuBrdfResults results;
    uint count;
    uint padding;
} push;

#endif
