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

struct SparseSample {
    vec4 at;
    vec3 value;
    uint pad;
};

// Written by src/render/brdf_table.rs.
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer SparseTable {
    uint count;
    uint is_isotropic;
    uvec2 pad;
    SparseSample samples[];
};

struct Brdf {
    uvec2 table;    // a SparseTable
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

float sparse_distance(SparseTable table, uint i, vec4 at) {
    vec4 away = table.samples[i].at - at;
    return dot(away, away) + SPARSE_SOFTENING;
}

#define BRDF_EVAL_ONE
vec3 brdf_eval(Brdf b, vec3 wo, vec3 wi) {
    SparseTable table = SparseTable(b.table);
    vec4 at = sparse_coordinates(wo, wi, table.is_isotropic != 0u);
    uint count = table.count;
    float nearest = sparse_distance(table, 0u, at);
    [[dont_unroll]] for (uint i = 1u; i < count; ++i) {
        nearest = min(nearest, sparse_distance(table, i, at));
    }
    vec4 sum = vec4(0.0);
    [[dont_unroll]] for (uint i = 0u; i < count; ++i) {
        float ratio = nearest / sparse_distance(table, i, at);
        ratio *= ratio;
        sum += ratio * ratio * vec4(table.samples[i].value, 1.0);
    }
    return sum.rgb / sum.a;
}

#include "lib/lobe.glsl"

#endif
