#ifndef LIB_HEMISPHERE_GLSL
#define LIB_HEMISPHERE_GLSL

#include "lib/circle.glsl"

// Directions with |cos θ| below this lie in the surface.
const float MIN_COSINE = 1e-6;

bool both_above(vec3 wo, vec3 wi) {
    return min(wo.z, wi.z) >= MIN_COSINE;
}

// Density cos θ / π: a point of the unit disk, lifted.
vec3 sample_cosine_hemisphere(vec2 u) {
    return vec3(sqrt(u.x) * unit_circle(u.y), sqrt(1.0 - u.x));
}

#endif
