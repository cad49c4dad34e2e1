// Samples, few and anywhere: src/material/sparse.rs.
#ifndef LIB_BSDF_SPARSE_GLSL
#define LIB_BSDF_SPARSE_GLSL

#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_EXT_control_flow_attributes : require
#extension GL_EXT_scalar_block_layout : require

#include "lib/bsdf.glsl"
#include "lib/half_difference.glsl"
#include "lib/lobe_table.glsl"

const float SPARSE_SOFTENING = 1e-8;

// Written by src/render/brdf_table.rs: one of these, and then samples, which are as long.
struct SparseRecord {
    uint count;
    uint is_isotropic;
    uvec2 pad;
    uvec4 pad_2;
};

struct SparseSampleRecord {
    vec4 at;
    vec3 value;
    uint pad;
};

layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer SparseTable {
    SparseRecord at[];
};

// The first one is the SparseRecord.
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer SparseSamples {
    SparseSampleRecord at[];
};

struct Brdf {
    uvec2 table;    // a SparseTable, and SparseSamples from the same place on
};

Brdf brdf_make(MaterialRecord material) {
    return Brdf(lobe_brdf_data(material));
}

vec4 sparse_coordinates(vec3 wo, vec3 wi, bool is_isotropic) {
    HalfDifference pair = half_difference(wo, wi);
    float theta = sqrt(half_angle(pair));
    vec2 a = pair.across;
    vec2 doubled = vec2((a.x - a.y) * (a.x + a.y), 2.0 * a.x * a.y) / max(length(a), 1e-30);
    return is_isotropic ? vec4(theta, 0.0, doubled.x, abs(doubled.y)) : vec4(theta * pair.azimuth, doubled);
}

float sparse_distance(SparseSamples samples, uint i, vec4 at) {
    vec4 away = samples.at[i].at - at;
    return dot(away, away) + SPARSE_SOFTENING;
}

#define BRDF_EVAL_ONE
vec3 brdf_eval(Brdf b, vec3 wo, vec3 wi) {
    SparseRecord record = SparseTable(b.table).at[0];
    SparseSamples samples = SparseSamples(b.table);
    vec4 at = sparse_coordinates(wo, wi, record.is_isotropic != 0u);
    float nearest = sparse_distance(samples, 1u, at);
    [[dont_unroll]] for (uint i = 2u; i <= record.count; ++i) {
        nearest = min(nearest, sparse_distance(samples, i, at));
    }
    vec4 sum = vec4(0.0);
    [[dont_unroll]] for (uint i = 1u; i <= record.count; ++i) {
        float ratio = nearest / sparse_distance(samples, i, at);
        ratio *= ratio;
        sum += ratio * ratio * vec4(samples.at[i].value, 1.0);
    }
    return sum.rgb / sum.a;
}

#include "lib/lobe.glsl"

#endif
