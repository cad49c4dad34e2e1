// The GGX distribution and Smith's shadowing: src/material/ggx.rs.
//
// With s(w) = |(αx x, αy y, z)|, Smith's terms are free of cancellation and of tangents:
//     G1(w) = 2 |z| / (|z| + s(w))
//     G2(o, i) = 2 |zo zi| / (|zo| s(i) + |zi| s(o))       height-correlated
#ifndef LIB_GGX_GLSL
#define LIB_GGX_GLSL

#include "lib/circle.glsl"

// s(w).
float ggx_stretch(vec3 w, vec2 alpha) {
    return length(vec3(alpha * w.xy, w.z));
}

// D of the facets along h, which may have any length: a half vector wo + wi of nearly opposite x, y is exact, so that
// D is accurate to a few ulp even where the lobe is 1e-4 wide.
float ggx_distribution(vec3 h, vec2 alpha) {
    vec3 stretched = vec3(h.xy / alpha, h.z);
    float ratio = dot(h, h) / dot(stretched, stretched);
    return ratio * ratio / (PI * alpha.x * alpha.y);
}

// A facet normal visible from wo, wo.z > 0: Dupuy and Benyoub 2023.
vec3 ggx_sample(vec3 wo, vec2 alpha, vec2 u) {
    vec3 stretched = normalize(vec3(alpha * wo.xy, wo.z));
    // The cap's z is 1 - below; written so, its sine is accurate where it is small.
    float below = u.x * (1.0 + stretched.z);
    float half_z = (1.0 - u.x) * (1.0 + stretched.z);
    float sine = sqrt(below * max(2.0 - below, 0.0));
    vec2 half_xy = sine * unit_circle(u.y) + stretched.xy;
    return normalize(vec3(alpha * half_xy, half_z));
}

#endif
