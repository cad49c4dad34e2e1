// Ends a batch: adds each pixel's samples to the film, in the order of their indices, so that neither the pool's size nor the
// point where a run was resumed changes a bit of the sums.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "layout/film.glsl"

layout(local_size_x_id = 0) in;
layout(constant_id = 9) const bool HAS_FEATURES = false;

// Knuth's two-sum: `sum` + `value`, the rounding error of which is added to `error`.
void add_compensated(inout vec3 sum, inout vec3 error, vec3 value) {
    precise vec3 total = sum + value;
    precise vec3 kept = total - sum;
    precise vec3 lost = (sum - (total - kept)) + (value - kept);
    sum = total;
    error += lost;
}

void main() {
    uint place = gl_GlobalInvocationID.x;
    if (place >= pixel_count) {
        return;
    }
    uint index = film_index(first_pixel + place);
    FilmPixel pixel = film.pixels.at[index];
    uint rejected = 0u;
    for (uint i = 0u; i < samples_per_pixel; ++i) {
        vec3 radiance = pool.radiance.at[place * samples_per_pixel + i].rgb;
        if (any(isnan(radiance)) || any(isinf(radiance))) {
            radiance = vec3(0.0);
            ++rejected;
        }
        add_compensated(pixel.sum, pixel.sum_error, radiance);
        add_compensated(pixel.square, pixel.square_error, radiance * radiance);
    }
    film.pixels.at[index] = pixel;
    if (rejected > 0u) {
        atomicAdd(film.rejected.at[0], rejected);
    }
    if (HAS_FEATURES) {
        FeaturePixel features = film.features.at[index];
        for (uint i = 0u; i < samples_per_pixel; ++i) {
            uint slot = place * samples_per_pixel + i;
            float share = 1.0 / float(first_sample + i + 1u);
            features.albedo += (film.first_albedo.at[slot].rgb - features.albedo) * share;
            features.normal += (film.first_normal.at[slot].xyz - features.normal) * share;
        }
        film.features.at[index] = features;
    }
}
