// A network over features that stand on two hemispheres: src/material/neubrdf.rs.
//
// Every invocation of a subgroup evaluates the same model, and two directions of light go through the network together, so that
// weights are loaded once for all. CPU drivers do not know that a load is the same for all invocations: there each
// invocation loads other weights, and they are handed around.
//
// Layers go in pairs. A pair's first layer is computed four neurons at a time, and what the second one takes from them is added at
// once to its sums: so no array is indexed by a variable, which would put it in memory. Of each pair `layers` holds, in groups of four
// numbers: the biases of the second layer; then for every four neurons of the first one their biases, what they take from each
// input, and what each output of the second one takes from them. A last layer without a partner: its biases, then for
// each four of its inputs what each output takes from them.
#ifndef LIB_NEUBRDF_GLSL
#define LIB_NEUBRDF_GLSL

#extension GL_EXT_control_flow_attributes : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_shuffle : require

#include "layout/neubrdf.glsl"
#include "lib/exponential.glsl"
#include "lib/healpix.glsl"

const uint NEUBRDF_INPUT_GROUPS = 2u * NEUBRDF_FEATURE_GROUPS;
const uint NEUBRDF_GROUPS = NEUBRDF_INPUT_GROUPS > NEUBRDF_HIDDEN_GROUPS ? NEUBRDF_INPUT_GROUPS : NEUBRDF_HIDDEN_GROUPS;
const uint NEUBRDF_PAIRS = NEUBRDF_LAYERS / 2u;
const bool NEUBRDF_IS_ODD = (NEUBRDF_LAYERS & 1u) != 0u;

// Four codes, weights or biases.
vec4 neubrdf_numbers(uvec2 table, uint group) {
    if (NEUBRDF_HALF) {
        uvec2 halves = NeuBrdfHalves(table).at[group];
        return vec4(unpackHalf2x16(halves.x), unpackHalf2x16(halves.y));
    }
    return NeuBrdfFloats(table).at[group];
}

// What invocations hold for one another of a run of groups.
struct NeuBrdfHeld {
    vec2 numbers;
};

// A group of a run that begins at group `first` of the table; to be called for all in turn, from 0 on, `place` being known when the
// kernel is built. The run may be read beyond its end.
vec4 neubrdf_next(uvec2 table, uint first, uint place, inout NeuBrdfHeld held) {
    if (NEUBRDF_LANES == 1u) {
        return neubrdf_numbers(table, first + place);
    }
    // Words of a group.
    const uint words = NEUBRDF_HALF ? 2u : 4u;
    uint lane = words * place % NEUBRDF_LANES;
    if (lane == 0u) {
        uint word = NeuBrdfWords(table).at[words * (first + place) + gl_SubgroupInvocationID % NEUBRDF_LANES];
        held.numbers = NEUBRDF_HALF ? unpackHalf2x16(word) : vec2(uintBitsToFloat(word));
    }
    if (NEUBRDF_HALF) {
        return vec4(subgroupShuffle(held.numbers, lane), subgroupShuffle(held.numbers, lane + 1u));
    }
    return vec4(subgroupShuffle(held.numbers.x, lane), subgroupShuffle(held.numbers.x, lane + 1u),
        subgroupShuffle(held.numbers.x, lane + 2u), subgroupShuffle(held.numbers.x, lane + 3u));
}

// Where an array begins, counted in groups of four numbers.
uint neubrdf_first(uint distance) {
    return NEUBRDF_HALF ? 2u * distance : distance;
}

// The weighted sum of the codes at the corners of the pixel of w, into x from `first` on.
void neubrdf_features(uvec2 table, SphereTableRecord sphere, bool has_equal_weights, vec3 w, uint first, inout vec4 x[NEUBRDF_GROUPS]) {
    NeuBrdfWords words = NeuBrdfWords(table);
    SphereCell cell = sphere_cell(sphere.n_side, w);
    if (sphere.levels != 0u) {
        uint pixel = sphere_pixel(sphere.n_side, cell);
        cell = sphere_ancestor(cell, words.at[4u * sphere.levels + (pixel >> 2)] >> (8u * (pixel & 3u)) & 0xffu);
    }
    SphereCorners corners = sphere_corners(sphere.n_side, cell);
    if (has_equal_weights) {
        bool is_triangle = corners.points.w == corners.points.x;
        corners.weights = cell.size == 1u ? vec4(0.25) : sphere_inverse_distances(cell.uv, is_triangle);
    }
    [[unroll]] for (uint corner = 0u; corner < 4u; ++corner) {
        uint point = corners.points[corner];
        uint code = words.at[4u * sphere.indices + (point >> 1)] >> (16u * (point & 1u)) & 0xffffu;
        uint group = neubrdf_first(sphere.codes) + code * NEUBRDF_FEATURE_GROUPS;
        [[unroll]] for (uint i = 0u; i < NEUBRDF_FEATURE_GROUPS; ++i) {
            vec4 feature = corners.weights[corner] * neubrdf_numbers(table, group + i);
            x[first + i] = corner == 0u ? feature : x[first + i] + feature;
        }
    }
}

// Sums of a pair of layers, without the second one's ReLU. If `shares`, the first half of the inputs, the features of wo, is the same
// for both.
void neubrdf_pair(uvec2 table, inout uint at, uint inputs, uint outputs, bool shares, inout vec4 x_1[NEUBRDF_GROUPS], inout vec4 x_2[NEUBRDF_GROUPS]) {
    vec4 sum_1[NEUBRDF_GROUPS];
    vec4 sum_2[NEUBRDF_GROUPS];
    [[unroll]] for (uint i = 0u; i < NEUBRDF_GROUPS; ++i) {
        if (i < outputs) {
            sum_1[i] = sum_2[i] = neubrdf_numbers(table, at + i);
        }
    }
    at += outputs;
    uint stride = 4u * inputs + 1u + 4u * outputs;
    [[dont_unroll]] for (uint block = 0u; block < NEUBRDF_HIDDEN_GROUPS; ++block) {
        uint start = at + block * stride;
        NeuBrdfHeld held;
        vec4 y_1 = neubrdf_next(table, start, 0u, held);
        vec4 y_2 = y_1;
        [[unroll]] for (uint i = 0u; i < 4u * NEUBRDF_GROUPS; ++i) {
            if (i < 4u * inputs) {
                vec4 weights = neubrdf_next(table, start, 1u + i, held);
                y_1 += weights * x_1[i >> 2][i & 3u];
                if (shares && i < 2u * inputs) {
                    y_2 = y_1;
                } else {
                    y_2 += weights * x_2[i >> 2][i & 3u];
                }
            }
        }
        y_1 = max(y_1, 0.0);
        y_2 = max(y_2, 0.0);
        [[unroll]] for (uint i = 0u; i < 4u * NEUBRDF_GROUPS; ++i) {
            if (i < 4u * outputs) {
                vec4 weights = neubrdf_next(table, start, 1u + 4u * inputs + i, held);
                sum_1[i >> 2][i & 3u] += dot(weights, y_1);
                sum_2[i >> 2][i & 3u] += dot(weights, y_2);
            }
        }
    }
    at += NEUBRDF_HIDDEN_GROUPS * stride;
    [[unroll]] for (uint i = 0u; i < NEUBRDF_GROUPS; ++i) {
        if (i < outputs) {
            x_1[i] = sum_1[i];
            x_2[i] = sum_2[i];
        }
    }
}

// wo turned about z, and mirrored, so that wi gets the azimuth 0 and wo one in [0, π]; 0 where either is the pole.
vec3 neubrdf_turned(vec3 wo, vec3 wi) {
    vec2 largest = max(abs(vec2(wo.x, wi.x)), abs(vec2(wo.y, wi.y)));
    vec2 turned = vec2(dot(wo.xy, wi.xy), abs(wo.x * wi.y - wo.y * wi.x));
    return vec3(min(largest.x, largest.y) < POLE ? vec2(length(wo.xy), 0.0) : turned / length(wi.xy), wo.z);
}

// The BRDF for an output of the network: src/scene/brdf/neubrdf.rs, Encoding.
vec3 neubrdf_decode(NeuBrdfTable header, vec3 y) {
    return expm1(clamp(header.scale * y, 0.0, header.most_exponent)) * header.inverse_gain;
}

// f(wo, wi), without the cosine, for directions above the surface. `table` is the same for all invocations of a subgroup.
void neubrdf_eval_pair(uvec2 table, vec3 wo, vec3 wi_1, vec3 wi_2, out vec3 f_1, out vec3 f_2) {
    NeuBrdfTable header = NeuBrdfTable(table);
    bool has_equal_weights = header.has_equal_weights != 0u;
    vec4 x_1[NEUBRDF_GROUPS];
    vec4 x_2[NEUBRDF_GROUPS];
    vec3 wo_1 = wo;
    vec3 wo_2 = wo;
    if (NEUBRDF_ISOTROPIC && header.is_isotropic != 0u) {
        wo_1 = neubrdf_turned(wo, wi_1);
        wo_2 = neubrdf_turned(wo, wi_2);
        wi_1 = vec3(length(wi_1.xy), 0.0, wi_1.z);
        wi_2 = vec3(length(wi_2.xy), 0.0, wi_2.z);
    }
    neubrdf_features(table, header.wi, has_equal_weights, wi_1, NEUBRDF_FEATURE_GROUPS, x_1);
    neubrdf_features(table, header.wi, has_equal_weights, wi_2, NEUBRDF_FEATURE_GROUPS, x_2);
    neubrdf_features(table, header.wo, has_equal_weights, wo_1, 0u, x_1);
    if (NEUBRDF_ISOTROPIC) {
        neubrdf_features(table, header.wo, has_equal_weights, wo_2, 0u, x_2);
    }
    uint at = neubrdf_first(header.layers);
    uint inputs = NEUBRDF_INPUT_GROUPS;
    [[unroll]] for (uint pair = 0u; pair < NEUBRDF_PAIRS; ++pair) {
        bool is_last = !NEUBRDF_IS_ODD && pair == NEUBRDF_PAIRS - 1u;
        neubrdf_pair(table, at, inputs, is_last ? 1u : NEUBRDF_HIDDEN_GROUPS, pair == 0u && !NEUBRDF_ISOTROPIC, x_1, x_2);
        inputs = NEUBRDF_HIDDEN_GROUPS;
        if (!is_last) {
            [[unroll]] for (uint i = 0u; i < NEUBRDF_HIDDEN_GROUPS; ++i) {
                x_1[i] = max(x_1[i], 0.0);
                x_2[i] = max(x_2[i], 0.0);
            }
        }
    }
    if (NEUBRDF_IS_ODD) {
        vec4 y_1 = neubrdf_numbers(table, at);
        vec4 y_2 = y_1;
        [[unroll]] for (uint i = 0u; i < NEUBRDF_GROUPS; ++i) {
            if (i < inputs) {
                [[unroll]] for (uint channel = 0u; channel < 3u; ++channel) {
                    vec4 weights = neubrdf_numbers(table, at + 1u + 3u * i + channel);
                    y_1[channel] += dot(weights, x_1[i]);
                    y_2[channel] += dot(weights, NEUBRDF_PAIRS == 0u && !NEUBRDF_ISOTROPIC && i < NEUBRDF_FEATURE_GROUPS ? x_1[i] : x_2[i]);
                }
            }
        }
        x_1[0] = y_1;
        x_2[0] = y_2;
    }
    f_1 = neubrdf_decode(header, x_1[0].xyz);
    f_2 = neubrdf_decode(header, x_2[0].xyz);
}

#endif
