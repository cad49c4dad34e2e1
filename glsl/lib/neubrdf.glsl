// A network over features that stand on two hemispheres: src/material/neubrdf.rs.
//
// NEUBRDF_DIRECTIONS directions of light, a macro, go through the network together, so that weights are loaded once for all.
//
// Layers go in pairs. A pair's first layer is computed four neurons at a time, and what the second one takes from them is added at
// once to its sums: so, once loops are unrolled, no array is indexed by a variable, which would put it in memory. Of each pair
// `layers` holds, in groups of four numbers: the biases of the second layer; then for every four neurons of the first one their
// biases, what they take from each input, and what each output of the second one takes from them. A last layer without a partner: its
// biases, then for each four of its inputs what each output takes from them.
//
// Where a model lies and how it is read is another file's: lib/neubrdf_by_address.glsl, lib/neubrdf_by_buffer.glsl. It includes
// this one behind
//
//     struct NeuBrdfTable;                                              a model's place
//     NeuBrdfHeader neubrdf_header(NeuBrdfTable table);
//     uint neubrdf_word(NeuBrdfTable table, uint index);
//     vec4 neubrdf_numbers(NeuBrdfTable table, uint group);             four codes, weights or biases
//     struct NeuBrdfRun;                                                numbers that are read one group after another
//     NeuBrdfRun neubrdf_run(NeuBrdfTable table, uint first);           from group `first` on
//     vec4 neubrdf_next(inout NeuBrdfRun run, uint place);              a group of it; for all in turn, from place 0 on
#ifndef LIB_NEUBRDF_GLSL
#define LIB_NEUBRDF_GLSL

#extension GL_EXT_control_flow_attributes : require

#include "layout/neubrdf.glsl"
#include "lib/exponential.glsl"
#include "lib/healpix.glsl"

// Features of the place, of wo, and of wi, and what is seen of the half vector.
const uint NEUBRDF_DIRECTION_GROUPS = NEUBRDF_RESOLUTIONS * NEUBRDF_FEATURE_GROUPS;
const uint NEUBRDF_FEATURE_END = NEUBRDF_SURFACE_GROUPS + 2u * NEUBRDF_DIRECTION_GROUPS;
const uint NEUBRDF_INPUT_GROUPS = NEUBRDF_FEATURE_END + (NEUBRDF_SEES_HALF_VECTOR ? 2u : 0u);
// Of these, what is the same for all directions of light: where some model is isotropic, wo's hang on them.
const uint NEUBRDF_SHARED_GROUPS = NEUBRDF_SURFACE_GROUPS + (NEUBRDF_ISOTROPIC ? 0u : NEUBRDF_DIRECTION_GROUPS);
const uint NEUBRDF_GROUPS = NEUBRDF_INPUT_GROUPS > NEUBRDF_HIDDEN_GROUPS ? NEUBRDF_INPUT_GROUPS : NEUBRDF_HIDDEN_GROUPS;
const uint NEUBRDF_SLOTS = NEUBRDF_DIRECTIONS * NEUBRDF_GROUPS;    // one direction after another
const uint NEUBRDF_PAIRS = NEUBRDF_LAYERS / 2u;
const bool NEUBRDF_IS_ODD = (NEUBRDF_LAYERS & 1u) != 0u;

// Where an array of numbers begins, counted in groups of four.
uint neubrdf_first(uint distance) {
    return NEUBRDF_HALF ? 2u * distance : distance;
}

#include "lib/neubrdf_surface.glsl"

// The weighted sum of the codes at the corners of a smallest pixel: features from slot `first` on.
void neubrdf_corners(NeuBrdfTable table, SphereTableRecord sphere, bool has_equal_weights, SphereCell cell, uint first, inout vec4 x[NEUBRDF_SLOTS]) {
    if (sphere.levels != 0u) {
        uint pixel = sphere_pixel(sphere.n_side, cell);
        cell = sphere_ancestor(cell, neubrdf_word(table, 4u * sphere.levels + (pixel >> 2)) >> (8u * (pixel & 3u)) & 0xffu);
    }
    SphereCorners corners = sphere_corners(sphere.n_side, cell);
    if (has_equal_weights) {
        bool is_triangle = corners.points.w == corners.points.x;
        corners.weights = cell.size == 1u ? vec4(0.25) : sphere_inverse_distances(cell.uv, is_triangle);
    }
    [[unroll]] for (uint corner = 0u; corner < 4u; ++corner) {
        uint point = corners.points[corner];
        uint code = neubrdf_word(table, 4u * sphere.indices + (point >> 1)) >> (16u * (point & 1u)) & 0xffffu;
        uint group = neubrdf_first(sphere.codes) + code * NEUBRDF_FEATURE_GROUPS;
        [[unroll]] for (uint i = 0u; i < NEUBRDF_FEATURE_GROUPS; ++i) {
            vec4 feature = corners.weights[corner] * neubrdf_numbers(table, group + i);
            x[first + i] = corner == 0u ? feature : x[first + i] + feature;
        }
    }
}

SphereTableRecord neubrdf_sphere(NeuBrdfTable table, uint word) {
    return SphereTableRecord(neubrdf_word(table, word), neubrdf_word(table, word + 1u), neubrdf_word(table, word + 2u),
        neubrdf_word(table, word + 3u));
}

// The features of a direction w on all grids of its hemisphere, from slot `first` on: `finest` is the record of the finest, and behind the
// header, every other one from `side` on, are those of the coarser. The place on the finest tells that on all.
void neubrdf_features(NeuBrdfTable table, SphereTableRecord finest, uint side, NeuBrdfHeader header, vec3 w, uint first, inout vec4 x[NEUBRDF_SLOTS]) {
    SphereCell cell = sphere_cell(finest.n_side, w);
    [[unroll]] for (uint coarser = 0u; coarser < NEUBRDF_RESOLUTIONS; ++coarser) {
        uint slot = first + coarser * NEUBRDF_FEATURE_GROUPS;
        if (coarser > 0u && coarser > header.coarser) {
            [[unroll]] for (uint i = 0u; i < NEUBRDF_FEATURE_GROUPS; ++i) {
                x[slot + i] = vec4(0.0);
            }
        } else {
            SphereTableRecord sphere = finest;
            uint steps = 0u;
            if (coarser > 0u) {
                sphere = neubrdf_sphere(table, NEUBRDF_HEADER_WORDS + 4u * (2u * coarser - 2u + side));
                steps = uint(findMSB(finest.n_side) - findMSB(sphere.n_side));
            }
            neubrdf_corners(table, sphere, header.has_equal_weights != 0u, sphere_coarser(cell, steps), slot, x);
        }
    }
}

// Sums of a pair of layers, whose numbers begin at group `at`, without the second one's ReLU. The first `shared_inputs` groups of the inputs are
// the same for all directions.
void neubrdf_pair(NeuBrdfTable table, inout uint at, uint inputs, uint outputs, uint shared_inputs, inout vec4 x[NEUBRDF_SLOTS]) {
    vec4 sum[NEUBRDF_SLOTS];
    [[unroll]] for (uint i = 0u; i < NEUBRDF_GROUPS; ++i) {
        if (i < outputs) {
            sum[i] = neubrdf_numbers(table, at + i);
            [[unroll]] for (uint d = 1u; d < NEUBRDF_DIRECTIONS; ++d) {
                sum[d * NEUBRDF_GROUPS + i] = sum[i];
            }
        }
    }
    at += outputs;
    [[dont_unroll]] for (uint block = 0u; block < NEUBRDF_HIDDEN_GROUPS; ++block) {
        NeuBrdfRun run = neubrdf_run(table, at);
        vec4 y[NEUBRDF_DIRECTIONS];
        y[0] = neubrdf_next(run, 0u);
        [[unroll]] for (uint d = 1u; d < NEUBRDF_DIRECTIONS; ++d) {
            y[d] = y[0];
        }
        [[unroll]] for (uint i = 0u; i < NEUBRDF_GROUPS; ++i) {
            if (i < inputs) {
                [[unroll]] for (uint c = 0u; c < 4u; ++c) {
                    vec4 weights = neubrdf_next(run, 1u + 4u * i + c);
                    [[unroll]] for (uint d = 0u; d < NEUBRDF_DIRECTIONS; ++d) {
                        y[d] = d > 0u && i < shared_inputs ? y[0] : y[d] + weights * x[d * NEUBRDF_GROUPS + i][c];
                    }
                }
            }
        }
        [[unroll]] for (uint d = 0u; d < NEUBRDF_DIRECTIONS; ++d) {
            y[d] = max(y[d], 0.0);
        }
        [[unroll]] for (uint i = 0u; i < NEUBRDF_GROUPS; ++i) {
            if (i < outputs) {
                [[unroll]] for (uint c = 0u; c < 4u; ++c) {
                    vec4 weights = neubrdf_next(run, 1u + 4u * inputs + 4u * i + c);
                    [[unroll]] for (uint d = 0u; d < NEUBRDF_DIRECTIONS; ++d) {
                        sum[d * NEUBRDF_GROUPS + i][c] += dot(weights, y[d]);
                    }
                }
            }
        }
        at += 4u * inputs + 1u + 4u * outputs;
    }
    [[unroll]] for (uint i = 0u; i < NEUBRDF_GROUPS; ++i) {
        if (i < outputs) {
            [[unroll]] for (uint d = 0u; d < NEUBRDF_DIRECTIONS; ++d) {
                x[d * NEUBRDF_GROUPS + i] = sum[d * NEUBRDF_GROUPS + i];
            }
        }
    }
}

// wo turned about z, and mirrored, so that wi gets the azimuth 0 and wo one in [0, π]; 0 where either is the pole.
vec3 neubrdf_turned(vec3 wo, vec3 wi) {
    vec2 largest = max(abs(vec2(wo.x, wi.x)), abs(vec2(wo.y, wi.y)));
    vec2 turned = vec2(dot(wo.xy, wi.xy), abs(wo.x * wi.y - wo.y * wi.x));
    return vec3(min(largest.x, largest.y) < POLE ? vec2(length(wo.xy), 0.0) : turned / length(wi.xy), wo.z);
}

// What the network sees of the half vector, from slot `first` on: src/material/half_vector.rs.
void neubrdf_half_vector(vec3 wo, vec3 wi, uint first, inout vec4 x[NEUBRDF_SLOTS]) {
    vec3 sum = wo + wi;
    vec2 half_vector = sum.xy / sqrt(dot(sum, sum) + 1e-4);
    vec3 sizes = vec3(abs(half_vector), length(half_vector));
    vec3 bent = sizes / (sizes + 0.05);
    x[first] = vec4(half_vector, sizes.xy);
    x[first + 1u] = vec4(bent, sizes.z);
}

// The BRDF for an output of the network: src/scene/brdf/neubrdf.rs, Encoding.
vec3 neubrdf_decode(NeuBrdfHeader header, vec3 y) {
    return expm1(clamp(header.scale * y, 0.0, header.most_exponent)) * header.inverse_gain;
}

// f(wo, wi) as seen at a place, without the cosine, for directions above the surface.
void neubrdf_values(NeuBrdfTable table, NeuBrdfPlace place, vec3 wo, vec3 wi[NEUBRDF_DIRECTIONS], out vec3 f[NEUBRDF_DIRECTIONS]) {
    NeuBrdfHeader header = neubrdf_header(table);
    vec4 x[NEUBRDF_SLOTS];
    float received[NEUBRDF_DIRECTIONS];
    if (NEUBRDF_SURFACE_GROUPS > 0u) {
        NeuBrdfFrame frame;
        neubrdf_surface_features(table, header.surface, place, x, frame);
        if (NEUBRDF_FRAMES) {
            neubrdf_turn(frame, wo, wi, received);
        }
    }
    [[unroll]] for (uint d = 0u; d < NEUBRDF_DIRECTIONS; ++d) {
        bool turns = NEUBRDF_ISOTROPIC && header.is_isotropic != 0u;
        vec3 wi_turned = turns ? vec3(length(wi[d].xy), 0.0, wi[d].z) : wi[d];
        vec3 wo_turned = turns ? neubrdf_turned(wo, wi[d]) : wo;
        uint first = d * NEUBRDF_GROUPS + NEUBRDF_SURFACE_GROUPS;
        neubrdf_features(table, header.wi, 0u, header, wi_turned, first + NEUBRDF_DIRECTION_GROUPS, x);
        // Where no model is isotropic, wo's are the same for all.
        if (d == 0u || NEUBRDF_ISOTROPIC) {
            neubrdf_features(table, header.wo, 1u, header, wo_turned, first, x);
        }
        if (NEUBRDF_SEES_HALF_VECTOR) {
            neubrdf_half_vector(wo_turned, wi_turned, d * NEUBRDF_GROUPS + NEUBRDF_FEATURE_END, x);
        }
    }
    uint at = neubrdf_first(header.layers);
    uint inputs = NEUBRDF_INPUT_GROUPS;
    [[unroll]] for (uint pair = 0u; pair < NEUBRDF_PAIRS; ++pair) {
        bool is_last = !NEUBRDF_IS_ODD && pair == NEUBRDF_PAIRS - 1u;
        neubrdf_pair(table, at, inputs, is_last ? 1u : NEUBRDF_HIDDEN_GROUPS, pair == 0u ? NEUBRDF_SHARED_GROUPS : 0u, x);
        inputs = NEUBRDF_HIDDEN_GROUPS;
        if (!is_last) {
            [[unroll]] for (uint i = 0u; i < NEUBRDF_HIDDEN_GROUPS; ++i) {
                [[unroll]] for (uint d = 0u; d < NEUBRDF_DIRECTIONS; ++d) {
                    x[d * NEUBRDF_GROUPS + i] = max(x[d * NEUBRDF_GROUPS + i], 0.0);
                }
            }
        }
    }
    if (NEUBRDF_IS_ODD) {
        vec4 bias = neubrdf_numbers(table, at);
        vec4 y[NEUBRDF_DIRECTIONS];
        [[unroll]] for (uint d = 0u; d < NEUBRDF_DIRECTIONS; ++d) {
            y[d] = bias;
        }
        [[unroll]] for (uint i = 0u; i < NEUBRDF_HIDDEN_GROUPS; ++i) {
            [[unroll]] for (uint channel = 0u; channel < 3u; ++channel) {
                vec4 weights = neubrdf_numbers(table, at + 1u + 3u * i + channel);
                [[unroll]] for (uint d = 0u; d < NEUBRDF_DIRECTIONS; ++d) {
                    y[d][channel] += dot(weights, x[d * NEUBRDF_GROUPS + i]);
                }
            }
        }
        [[unroll]] for (uint d = 0u; d < NEUBRDF_DIRECTIONS; ++d) {
            x[d * NEUBRDF_GROUPS] = y[d];
        }
    }
    [[unroll]] for (uint d = 0u; d < NEUBRDF_DIRECTIONS; ++d) {
        f[d] = neubrdf_decode(header, x[d * NEUBRDF_GROUPS].xyz);
        if (NEUBRDF_FRAMES) {
            f[d] *= received[d];
        }
    }
}

#endif
