// Push constants of the error estimate.
#ifndef LAYOUT_ERROR
#define LAYOUT_ERROR

#include "layout/film_pixel.glsl"

layout(buffer_reference, scalar, buffer_reference_align = 4) writeonly buffer FloatArray {
    float at[];
};

layout(push_constant, scalar) uniform ErrorPass {
    FilmPixelArray pixels;
    FloatArray partial_sums;
    uint pixel_count;
    float sample_count;
};

#endif
