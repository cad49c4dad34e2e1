// What the film keeps of a pixel.
#ifndef LAYOUT_FILM_PIXEL
#define LAYOUT_FILM_PIXEL

#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require

// Sums over a pixel's samples, each with the rounding error that its additions have lost so far.
struct FilmPixel {
    vec3 sum;
    vec3 sum_error;
    vec3 square;
    vec3 square_error;
};
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer FilmPixelArray {
    FilmPixel at[];
};

// What a pixel sees first. Albedo and normal are means over its samples; depth (along the axis, infinite where nothing is) and ids
// are those of one ray through its centre, since their means would mean nothing.
struct FeaturePixel {
    vec3 albedo;
    vec3 normal;
    float depth;
    uint instance;
    uint triangle;
    uint material;
};
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer FeaturePixelArray {
    FeaturePixel at[];
};

#endif
