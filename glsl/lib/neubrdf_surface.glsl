// Features of a place on a surface that varies: src/scene/brdf/surface_table.rs. Included by lib/neubrdf.glsl, which says what reads a model.
//
// At the group `surface` of a model's header: texels across and down, the number of levels, and where codes begin; in the next group where
// indices begin; then a group for each level: texels across, down, and its first point.
#ifndef LIB_NEUBRDF_SURFACE_GLSL
#define LIB_NEUBRDF_SURFACE_GLSL

// What is looked at.
struct NeuBrdfPlace {
    vec2 uv;
    float area;    // in the units of uv
};

// All of the texture.
const NeuBrdfPlace NEUBRDF_WHOLE = NeuBrdfPlace(vec2(0.0), 1e12);

// Adds a share of what is bilinear between the texels of a level about uv to the first groups of x.
void neubrdf_add_texels(NeuBrdfTable table, uint surface, uint level, float share, vec2 uv, inout vec4 x[NEUBRDF_SLOTS]) {
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
    uvec4 points = first + uvec4(low.y * size.x + low.x, low.y * size.x + high.x, high.y * size.x + low.x, high.y * size.x + high.x);
    vec4 weights = share * vec4((1.0 - across.x) * (1.0 - across.y), across.x * (1.0 - across.y), (1.0 - across.x) * across.y, across.x * across.y);
    uint codes = neubrdf_first(neubrdf_word(table, 4u * surface + 3u));
    uint indices = 4u * neubrdf_word(table, 4u * surface + 4u);
    [[unroll]] for (uint texel = 0u; texel < 4u; ++texel) {
        uint point = points[texel];
        uint code = neubrdf_word(table, indices + (point >> 1)) >> (16u * (point & 1u)) & 0xffffu;
        [[unroll]] for (uint i = 0u; i < NEUBRDF_SURFACE_GROUPS; ++i) {
            x[i] += weights[texel] * neubrdf_numbers(table, codes + code * NEUBRDF_SURFACE_GROUPS + i);
        }
    }
}

// The features of a place, the first groups of x: those of the level whose texels are as large as the place, a real number, linearly
// between two. Zeros where the model does not vary.
void neubrdf_surface_features(NeuBrdfTable table, uint surface, NeuBrdfPlace place, inout vec4 x[NEUBRDF_SLOTS]) {
    [[unroll]] for (uint i = 0u; i < NEUBRDF_SURFACE_GROUPS; ++i) {
        x[i] = vec4(0.0);
    }
    if (surface == 0u) {
        return;
    }
    vec2 size = vec2(neubrdf_word(table, 4u * surface), neubrdf_word(table, 4u * surface + 1u));
    uint last = neubrdf_word(table, 4u * surface + 2u) - 1u;
    float level = min(0.5 * log2(clamp(place.area * size.x * size.y, 1.0, 1e12)), float(last));
    uint fine = uint(level);
    float blend = level - float(fine);
    neubrdf_add_texels(table, surface, fine, 1.0 - blend, place.uv, x);
    neubrdf_add_texels(table, surface, min(fine + 1u, last), blend, place.uv, x);
}

#endif
