// Features and frames of a place on a surface that varies: src/scene/brdf/surface_table.rs, surface_frames.rs. Included by lib/neubrdf.glsl,
// which says what reads a model.
//
// At the group `surface` of a model's header: texels across and down, the number of levels, and where codes begin; in the next group where
// indices begin and where frames do, 0 where there are none; then a group for each level: texels across, down, and its first point.
// A texel's frame is two words of signed fractions: x and y of its normal, and (cos 2ψ, sin 2ψ).
#ifndef LIB_NEUBRDF_SURFACE_GLSL
#define LIB_NEUBRDF_SURFACE_GLSL

#include "lib/half_angle.glsl"
#include "lib/hemisphere.glsl"

// What is looked at.
struct NeuBrdfPlace {
    vec2 uv;
    float area;    // in the units of uv
};

// All of the texture.
const NeuBrdfPlace NEUBRDF_WHOLE = NeuBrdfPlace(vec2(0.0), 1e12);

// A frame, or a sum of frames.
struct NeuBrdfFrame {
    vec3 normal;
    vec2 doubled;    // (cos 2ψ, sin 2ψ)
};

// Lowest cosine that light is divided by.
const float NEUBRDF_LEAST_COSINE = 0.1;

// Adds a share of what is bilinear between the texels of a level about uv to the first groups of x and to a frame.
void neubrdf_add_texels(NeuBrdfTable table, uint surface, uint level, float share, vec2 uv, inout vec4 x[NEUBRDF_SLOTS], inout NeuBrdfFrame frame) {
    uint at = 4u * (surface + 2u + level);
    ivec2 size = ivec2(neubrdf_word(table, at), neubrdf_word(table, at + 1u));
    uint first = neubrdf_word(table, at + 2u);
    vec2 wrapped = uv - floor(uv);
    vec2 position = vec2(wrapped.x, 1.0 - wrapped.y) * vec2(size) - 0.5;
    vec2 corner = floor(position);
    vec2 across = position - corner;
    // At most one step outside.
    ivec2 low = ivec2(corner);
    ivec2 high = low + 1;
    low += ivec2(lessThan(low, ivec2(0))) * size;
    high -= ivec2(greaterThanEqual(high, size)) * size;
    // Coordinates that are no numbers end at some texel, too.
    low = clamp(low, ivec2(0), size - 1);
    high = clamp(high, ivec2(0), size - 1);
    uvec4 points = first + uvec4(low.y * size.x + low.x, low.y * size.x + high.x, high.y * size.x + low.x, high.y * size.x + high.x);
    vec4 weights = share * vec4((1.0 - across.x) * (1.0 - across.y), across.x * (1.0 - across.y), (1.0 - across.x) * across.y, across.x * across.y);
    uint codes = neubrdf_first(neubrdf_word(table, 4u * surface + 3u));
    uint indices = 4u * neubrdf_word(table, 4u * surface + 4u);
    uint frames = NEUBRDF_FRAMES ? 4u * neubrdf_word(table, 4u * surface + 5u) : 0u;
    [[unroll]] for (uint texel = 0u; texel < 4u; ++texel) {
        uint point = points[texel];
        uint code = neubrdf_word(table, indices + (point >> 1)) >> (16u * (point & 1u)) & 0xffffu;
        [[unroll]] for (uint i = 0u; i < NEUBRDF_SURFACE_GROUPS; ++i) {
            x[i] += weights[texel] * neubrdf_numbers(table, codes + code * NEUBRDF_SURFACE_GROUPS + i);
        }
        if (NEUBRDF_FRAMES && frames != 0u) {
            vec2 across = unpackSnorm2x16(neubrdf_word(table, frames + 2u * point));
            frame.normal += weights[texel] * vec3(across, sqrt(1.0 - dot(across, across)));
            frame.doubled += weights[texel] * unpackSnorm2x16(neubrdf_word(table, frames + 2u * point + 1u));
        }
    }
}

// The features of a place, the first groups of x: those of the level whose texels are as large as the place, a real number, linearly
// between two. Zeros where the model does not vary. And the sum of frames; a zero normal where the model has none.
void neubrdf_surface_features(NeuBrdfTable table, uint surface, NeuBrdfPlace place, inout vec4 x[NEUBRDF_SLOTS], out NeuBrdfFrame frame) {
    frame = NeuBrdfFrame(vec3(0.0), vec2(0.0));
    [[unroll]] for (uint i = 0u; i < NEUBRDF_SURFACE_GROUPS; ++i) {
        x[i] = vec4(0.0);
    }
    if (surface == 0u) {
        return;
    }
    vec2 size = vec2(neubrdf_word(table, 4u * surface), neubrdf_word(table, 4u * surface + 1u));
    uint last = neubrdf_word(table, 4u * surface + 2u) - 1u;
    float level = min(0.5 * log2(clamp(place.area * size.x * size.y, 1.0, 1e12)), float(last));
    uint fine = min(uint(level), last);
    float blend = level - float(fine);
    neubrdf_add_texels(table, surface, fine, 1.0 - blend, place.uv, x, frame);
    neubrdf_add_texels(table, surface, min(fine + 1u, last), blend, place.uv, x, frame);
}

// The tangent, bitangent and normal of a sum of frames: src/material/surface_frame.rs.
mat3 neubrdf_axes(NeuBrdfFrame frame) {
    vec3 normal = normalize(frame.normal);
    vec3 across = vec3(0.0, normal.z, -normal.y) / length(normal.yz);
    vec3 along = cross(across, normal);
    vec2 turn = half_angle(frame.doubled);
    return mat3(turn.x * along + turn.y * across, turn.x * across - turn.y * along, normal);
}

// Turns directions into a sum of frames, if there is one. What it receives of each light over what the surface does; 0 where a direction is
// below it.
void neubrdf_turn(NeuBrdfFrame frame, inout vec3 wo, inout vec3 wi[NEUBRDF_DIRECTIONS], out float received[NEUBRDF_DIRECTIONS]) {
    bool has_frame = frame.normal.z > 0.0;
    mat3 axes = has_frame ? neubrdf_axes(frame) : mat3(1.0);
    wo = has_frame ? wo * axes : wo;
    [[unroll]] for (uint d = 0u; d < NEUBRDF_DIRECTIONS; ++d) {
        float own = wi[d].z;
        wi[d] = has_frame ? wi[d] * axes : wi[d];
        float leaning = both_above(wo, wi[d]) ? wi[d].z : 0.0;
        received[d] = has_frame ? leaning / max(own, min(leaning, NEUBRDF_LEAST_COSINE)) : 1.0;
    }
}

#endif
