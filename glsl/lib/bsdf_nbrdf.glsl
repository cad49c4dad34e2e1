// A network from half and difference vector to ln(1 + BRDF): src/material/nbrdf.rs.
#ifndef LIB_BSDF_NBRDF_GLSL
#define LIB_BSDF_NBRDF_GLSL

#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_EXT_control_flow_attributes : require
#extension GL_EXT_scalar_block_layout : require

#include "lib/bsdf.glsl"
#include "lib/exponential.glsl"
#include "lib/lobe_table.glsl"

const uint NBRDF_HIDDEN = 21u;
const uint NBRDF_GROUPS = 6u;                    // of four numbers: the hidden neurons, filled up
const uint NBRDF_NEURON = 2u + NBRDF_GROUPS;
const uint NBRDF_LAYER_2 = NBRDF_HIDDEN * NBRDF_NEURON;
const uint NBRDF_LAYER_3 = NBRDF_LAYER_2 + NBRDF_GROUPS;
const float NBRDF_LARGEST_OUTPUT = 25.0;

// Written by src/render/brdf_table.rs. For each neuron of the first layer two groups: its weights of sin θh, cos θh, d and its bias;
// and NBRDF_GROUPS: the weights with which the second layer's neurons take it. From NBRDF_LAYER_2 on their biases, from NBRDF_LAYER_3 on
// what red, green and blue take from them, then their biases.
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer NbrdfTable {
    vec4 at[];
};

struct Brdf {
    uvec2 table;    // a NbrdfTable
};

Brdf brdf_make(MaterialRecord material) {
    return Brdf(lobe_brdf_data(material));
}

struct NbrdfInput {
    vec4 first;    // sin θh, cos θh, d.x, d.y
    float last;    // d.z
};

NbrdfInput nbrdf_input(vec3 wo, vec3 wi) {
    vec3 h = normalize(wo + wi);
    float sine = length(h.xy);
    vec2 phi = sine > 0.0 ? h.xy / sine : vec2(1.0, 0.0);
    float along = dot(phi, wi.xy);
    float across = phi.x * wi.y - phi.y * wi.x;
    return NbrdfInput(vec4(sine, h.z, h.z * along - sine * wi.z, across), sine * along + h.z * wi.z);
}

void brdf_eval_pair(Brdf b, vec3 wo, vec3 wi_1, vec3 wi_2, out vec3 f_1, out vec3 f_2) {
    NbrdfTable table = NbrdfTable(b.table);
    NbrdfInput input_1 = nbrdf_input(wo, wi_1);
    NbrdfInput input_2 = nbrdf_input(wo, wi_2);
    vec4 sum_1[NBRDF_GROUPS];
    vec4 sum_2[NBRDF_GROUPS];
    [[unroll]] for (uint i = 0u; i < NBRDF_GROUPS; ++i) {
        sum_1[i] = sum_2[i] = table.at[NBRDF_LAYER_2 + i];
    }
    // Each neuron of the first layer is handed on at once, so that no array is indexed by a variable.
    [[dont_unroll]] for (uint neuron = 0u; neuron < NBRDF_HIDDEN; ++neuron) {
        uint start = neuron * NBRDF_NEURON;
        vec4 first = table.at[start];
        vec4 rest = table.at[start + 1u];
        float value_1 = max(dot(first, input_1.first) + (rest.x * input_1.last + rest.y), 0.0);
        float value_2 = max(dot(first, input_2.first) + (rest.x * input_2.last + rest.y), 0.0);
        [[unroll]] for (uint i = 0u; i < NBRDF_GROUPS; ++i) {
            vec4 weights = table.at[start + 2u + i];
            sum_1[i] += value_1 * weights;
            sum_2[i] += value_2 * weights;
        }
    }
    f_1 = f_2 = table.at[NBRDF_LAYER_3 + 3u * NBRDF_GROUPS].xyz;
    [[unroll]] for (uint channel = 0u; channel < 3u; ++channel) {
        [[unroll]] for (uint i = 0u; i < NBRDF_GROUPS; ++i) {
            vec4 weights = table.at[NBRDF_LAYER_3 + channel * NBRDF_GROUPS + i];
            f_1[channel] += dot(weights, max(sum_1[i], 0.0));
            f_2[channel] += dot(weights, max(sum_2[i], 0.0));
        }
    }
    f_1 = expm1(clamp(f_1, 0.0, NBRDF_LARGEST_OUTPUT));
    f_2 = expm1(clamp(f_2, 0.0, NBRDF_LARGEST_OUTPUT));
}

#include "lib/lobe.glsl"

#endif
