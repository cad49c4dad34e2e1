// Random numbers as a pure function of (pixel, sample index, dimension, seed).
//
// SAMPLER 0: Owen-scrambled (0,2)-sequences, padded: each pair of dimensions shuffles the sample index and scrambles both
// coordinates by hashing (Burley, "Practical Hash-based Owen Scrambling", JCGT 9(4), 2020; the hash is Vegdahl's).
// SAMPLER 1: independent numbers from pcg3d.
#ifndef LIB_SAMPLER
#define LIB_SAMPLER

#include "lib/pcg.glsl"

layout(constant_id = 1) const uint SAMPLER = 0u;

const uint SAMPLER_SOBOL = 0u;

// Pairs of dimensions: two for the camera, then DIMENSIONS_PER_BOUNCE for each bounce.
const uint DIMENSION_PIXEL = 0u;
const uint DIMENSION_LENS = 1u;
const uint DIMENSION_LIGHT = 2u;
const uint DIMENSION_BSDF = 3u;
const uint DIMENSION_LOBE_ROULETTE = 4u;
const uint DIMENSIONS_PER_BOUNCE = 3u;

// What identifies a sample: the scramble of its pixel, and its index within the pixel.
struct SampleKey {
    uint pixel;
    uint index;
};

SampleKey sample_key(uvec2 pixel, uint index, uint seed) {
    return SampleKey(pcg3d(uvec3(pixel, seed)).x, index);
}

// Permutes the bits of x so that each depends on those below it alone: an Owen scramble in bit-reversed order.
uint laine_karras(uint x, uint seed) {
    x ^= x * 0x3d20adeau;
    x += seed;
    x *= (seed >> 16u) | 1u;
    x ^= x * 0x05526c56u;
    x ^= x * 0x53a22864u;
    return x;
}

// The second Sobol' dimension, bit-reversed: bit j is the sum of the index bits k with j ⊆ k (Pascal's triangle mod 2).
uint sobol_second_reversed(uint index) {
    index ^= (index >> 1u) & 0x55555555u;
    index ^= (index >> 2u) & 0x33333333u;
    index ^= (index >> 4u) & 0x0f0f0f0fu;
    index ^= (index >> 8u) & 0x00ff00ffu;
    return index ^ (index >> 16u);
}

// The pair of 32-bit fractions that belongs to a dimension.
uvec2 sample_bits(SampleKey key, uint dimension) {
    uvec3 hashes = pcg3d(uvec3(key.pixel, dimension, SAMPLER == SAMPLER_SOBOL ? 0u : key.index));
    if (SAMPLER != SAMPLER_SOBOL) {
        return hashes.xy;
    }
    uint index = bitfieldReverse(laine_karras(bitfieldReverse(key.index), hashes.x));
    uint x = laine_karras(index, hashes.y);
    uint y = laine_karras(sobol_second_reversed(index), hashes.z);
    return bitfieldReverse(uvec2(x, y));
}

// A 32-bit fraction in [0, 1), to 24 bits.
float unit_interval(uint fraction) {
    return float(fraction >> 8u) * (1.0 / 16777216.0);
}

// The pair of numbers in [0, 1)² that belongs to a dimension.
vec2 sample_2d(SampleKey key, uint dimension) {
    uvec2 bits = sample_bits(key, dimension);
    return vec2(unit_interval(bits.x), unit_interval(bits.y));
}

#endif
