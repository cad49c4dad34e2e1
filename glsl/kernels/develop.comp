// Develops the film: each pixel's mean so far, packed as a host's image or buffer wants it.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "layout/develop.glsl"
#include "lib/tone_map.glsl"

layout(local_size_x_id = 0) in;

// a · b = product + lost, both of 24 bits (Dekker 1971, after Veltkamp's splitting).
void multiply_exactly(vec3 a, float b, out vec3 product, out vec3 lost) {
    const float SPLITTER = 4097.0;
    precise vec3 a_scaled = SPLITTER * a;
    precise vec3 a_high = a_scaled - (a_scaled - a);
    precise vec3 a_low = a - a_high;
    precise float b_scaled = SPLITTER * b;
    precise float b_high = b_scaled - (b_scaled - b);
    precise float b_low = b - b_high;
    precise vec3 p = a * b;
    precise vec3 rest = ((a_high * b_high - p) + a_high * b_low + a_low * b_high) + a_low * b_low;
    product = p;
    lost = rest;
}

// (sum + error) / count. What the quotient times the count lacks of the sum is divided once more, so that the mean is rounded
// as if it had been computed in double precision, all but ties.
vec3 mean(vec3 sum, vec3 error, float count) {
    vec3 product, lost;
    precise vec3 quotient = sum / count;
    multiply_exactly(quotient, count, product, lost);
    precise vec3 remainder = ((sum - product) - lost) + error;
    precise vec3 corrected = quotient + remainder / count;
    return corrected;
}

vec4 value(uint index) {
    if (channel == CHANNEL_BEAUTY) {
        FilmPixel pixel = pixels.at[index];
        return vec4(sample_count == 0u ? vec3(0.0) : mean(pixel.sum, pixel.sum_error, float(sample_count)), 1.0);
    }
    FeaturePixel pixel = features.at[index];
    if (channel == CHANNEL_ALBEDO) {
        return vec4(pixel.albedo, 1.0);
    }
    return channel == CHANNEL_NORMAL ? vec4(pixel.normal, 1.0) : vec4(vec3(pixel.depth), 1.0);
}

uint pack_bytes(vec3 color) {
    uvec3 bytes = uvec3(floor(clamp(color, 0.0, 1.0) * 255.0 + 0.5));
    bytes = format == FORMAT_BGRA8 ? bytes.bgr : bytes;
    return bytes.r | bytes.g << 8 | bytes.b << 16 | 255u << 24;
}

void develop(uint index) {
    vec4 color = value(index);
    if (format == FORMAT_RGBA32F) {
        uvec4 words = floatBitsToUint(color);
        for (uint i = 0u; i < 4u; ++i) {
            packed_pixels.at[4u * index + i] = words[i];
        }
    } else if (format == FORMAT_RGBA16F) {
        vec4 half_range = clamp(color, -65504.0, 65504.0);
        packed_pixels.at[2u * index] = packHalf2x16(half_range.rg);
        packed_pixels.at[2u * index + 1u] = packHalf2x16(half_range.ba);
    } else {
        packed_pixels.at[index] = pack_bytes(encode_srgb(neutral(color.rgb * exp2(exposure))));
    }
}

void main() {
    uint step = gl_NumWorkGroups.x * gl_WorkGroupSize.x;
    for (uint index = gl_GlobalInvocationID.x; index < pixel_count; index += step) {
        develop(index);
    }
}
