// The camera, the film, and the push constants that every pass of the wavefront shares.
#ifndef LAYOUT_FILM
#define LAYOUT_FILM

#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require

#include "layout/film_pixel.glsl"
#include "layout/path.glsl"
#include "layout/scene.glsl"

// A direction through the film is corner + x·right + y·down, (x, y) in pixels; its part along the optical axis is 1.
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer CameraRecord {
    vec3 eye;
    vec3 axis;               // unit, where the camera looks
    vec3 corner;
    vec3 right;
    vec3 down;
    vec3 lens_right;         // times the lens radius
    vec3 lens_up;            // times the lens radius
    float focus_distance;
};

layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer FilmTable {
    CameraRecord camera;
    FilmPixelArray pixels;
    FeaturePixelArray features;
    UIntArray rejected;      // [0]: samples that were not finite and counted as black
    uvec2 crop_origin;       // upper left pixel of what is rendered
    uvec2 crop_size;
    Vec4Array first_albedo;  // of the batch, by slot. rgb: of what the camera ray hit
    Vec4Array first_normal;  // xyz: of what the camera ray hit, world space, facing the camera
    Vec4Array reuse;         // by slot, for each of its fields: lib/reuse.glsl
    uint seed;
    uint padding;
};

// One ray through each pixel's centre, for depth and ids.
const uint VARIANT_PROBE = 1u;

layout(push_constant, scalar) uniform Pass {
    SceneTable scene;
    FilmTable film;
    PathPool pool;
    uint capacity;           // slots of the pool
    uint bounce;             // 0 at the camera ray
    uint max_depth;          // path segments
    uint first_pixel;        // of this batch, in the order of `pixel_at`
    uint pixel_count;
    uint first_sample;
    uint samples_per_pixel;  // of this batch: slot = pixel · samples_per_pixel + sample
    uint variant;            // of `shade`: which of the family's queues. Of others: VARIANT_PROBE, or 0
};

// Rows of a band. Bands follow one another downwards, and columns within a band: so neighbours in this order are neighbours in the
// picture, and BAND · BAND of them a square.
const uint BAND = 8u;

// The pixel of the crop at a place of that order.
uvec2 pixel_at(uint place) {
    uint band = place / (BAND * film.crop_size.x);
    uint in_band = place - band * BAND * film.crop_size.x;
    uint rows = min(BAND, film.crop_size.y - BAND * band);
    uint column = in_band / rows;
    return uvec2(column, BAND * band + in_band - column * rows);
}

// Where the film keeps it.
uint film_index(uint place) {
    uvec2 pixel = pixel_at(place);
    return pixel.y * film.crop_size.x + pixel.x;
}

#endif
