// Half and difference angles: src/scene/brdf/half_difference.rs.
#ifndef LIB_HALF_DIFFERENCE_GLSL
#define LIB_HALF_DIFFERENCE_GLSL

#include "lib/circle.glsl"

struct HalfDifference {
    vec2 azimuth;     // of the half vector, a unit vector
    float sine;       // of its angle to the normal
    float cosine;
    vec2 across;      // sin θd at azimuth φd
    float cosine_difference;
};

HalfDifference half_difference(vec3 wo, vec3 wi) {
    vec3 sum = wo + wi;
    float size = length(sum);
    vec3 h = sum / size;
    vec3 difference = 0.5 * (wi - wo);
    float sine = length(h.xy);
    vec2 azimuth = sine > 0.0 ? h.xy / sine : vec2(1.0, 0.0);
    float outward = dot(azimuth, difference.xy);
    float sideward = azimuth.x * difference.y - azimuth.y * difference.x;
    return HalfDifference(azimuth, sine, h.z, vec2(h.z * outward - sine * difference.z, sideward), 0.5 * size);
}

// θh / (π/2).
float half_angle(HalfDifference pair) {
    return 4.0 * turn_of(pair.sine, pair.cosine);
}

// θd / (π/2).
float difference_angle(HalfDifference pair) {
    return 4.0 * turn_of(length(pair.across), pair.cosine_difference);
}

// φd / π in [0, 1], as of wi and of wo alike.
float difference_azimuth(HalfDifference pair) {
    return fract(2.0 * turn_of(pair.across.y, pair.across.x));
}

#endif
