// The picture's estimated error: the mean over its pixels of the standard error of the luminance over (luminance + 0.01).
// Each workgroup leaves one partial sum.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "layout/error.glsl"

layout(local_size_x_id = 0) in;
layout(constant_id = 0) const uint WORKGROUP_SIZE = 64u;

shared float partial[WORKGROUP_SIZE];

float relative_error(FilmPixel pixel) {
    const vec3 luminance = vec3(0.2126, 0.7152, 0.0722);
    vec3 mean = (pixel.sum + pixel.sum_error) / sample_count;
    vec3 mean_square = (pixel.square + pixel.square_error) / sample_count;
    // Channels rise and fall together: their standard deviations add.
    vec3 deviation = sqrt(max(vec3(0.0), mean_square - mean * mean) / max(1.0, sample_count - 1.0));
    return dot(deviation, luminance) / (dot(mean, luminance) + 0.01);
}

void main() {
    float sum = 0.0;
    for (uint i = gl_GlobalInvocationID.x; i < pixel_count; i += gl_NumWorkGroups.x * WORKGROUP_SIZE) {
        sum += relative_error(pixels.at[i]);
    }
    partial[gl_LocalInvocationID.x] = sum;
    for (uint stride = WORKGROUP_SIZE / 2u; stride > 0u; stride /= 2u) {
        barrier();
        if (gl_LocalInvocationID.x < stride) {
            partial[gl_LocalInvocationID.x] += partial[gl_LocalInvocationID.x + stride];
        }
    }
    if (gl_LocalInvocationID.x == 0u) {
        partial_sums.at[gl_WorkGroupID.x] = partial[0];
    }
}
