// Push constants of the kernel that develops the film.
#ifndef LAYOUT_DEVELOP
#define LAYOUT_DEVELOP

#include "layout/film_pixel.glsl"

layout(buffer_reference, scalar, buffer_reference_align = 4) writeonly buffer PackedArray {
    uint at[];
};

// src/plugin/target.rs has them once more.
const uint CHANNEL_BEAUTY = 0u;
const uint CHANNEL_ALBEDO = 1u;
const uint CHANNEL_NORMAL = 2u;
const uint CHANNEL_DEPTH = 3u;

const uint FORMAT_RGBA32F = 0u;
const uint FORMAT_RGBA16F = 1u;
const uint FORMAT_RGBA8 = 2u;
const uint FORMAT_BGRA8 = 3u;

layout(push_constant, scalar) uniform DevelopPass {
    FilmPixelArray pixels;
    FeaturePixelArray features;   // null where none are gathered
    PackedArray packed_pixels;
    uint pixel_count;
    uint sample_count;
    uint channel;
    uint format;
    float exposure;               // 8-bit formats show radiance · 2^exposure
    uint padding;
};

#endif
