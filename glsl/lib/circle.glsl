#ifndef LIB_CIRCLE_GLSL
#define LIB_CIRCLE_GLSL

#include "lib/constants.glsl"

// (cos 2πu, sin 2πu) for u in [0, 1], to an ulp of 1. Vulkan's own sin and cos may be off by 2^-11, which makes directions of
// another length than 1, and differ between drivers. Polynomials: Cephes, sinf.c and cosf.c.
vec2 unit_circle(float u) {
    float quarter = floor(4.0 * u + 0.5);
    float x = (4.0 * u - quarter) * (0.25 * TWO_PI);
    float x2 = x * x;
    float sine = x + x * x2 * (-1.6666654611e-1 + x2 * (8.3321608736e-3 - 1.9515295891e-4 * x2));
    float cosine = 1.0 - 0.5 * x2 + x2 * x2 * (4.1666645683e-2 + x2 * (-1.3887316255e-3 + 2.4433157118e-5 * x2));
    uint turn = uint(quarter);
    vec2 point = (turn & 1u) != 0u ? vec2(-sine, cosine) : vec2(cosine, sine);
    return (turn & 2u) != 0u ? -point : point;
}

// atan(y, x) / 2π in [-1/2, 1/2], to 2e-8. Vulkan's own may be off by 4096 ulp, more than a part of a sky texel. After Cephes, atanf.c.
float turn_of(float y, float x) {
    float least = min(abs(x), abs(y));
    float most = max(abs(x), abs(y));
    // Beyond tan(π/8): atan(r) = π/4 + atan((r - 1) / (r + 1)).
    bool is_wide = least > 0.4142135624 * most;
    float ratio = is_wide ? (least - most) / (least + most) : least / max(most, 1e-30);
    float z = ratio * ratio;
    float angle = ratio + ratio * z * (-3.33329491539e-1 + z * (1.99777106478e-1 + z * (-1.38776856032e-1 + z * 8.05374449538e-2)));
    float turn = angle * (0.5 * INV_PI) + (is_wide ? 0.125 : 0.0);
    turn = abs(y) > abs(x) ? 0.25 - turn : turn;
    turn = x < 0.0 ? 0.5 - turn : turn;
    return y < 0.0 ? -turn : turn;
}

#endif
