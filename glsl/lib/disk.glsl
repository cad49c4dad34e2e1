// The concentric map of the unit square to the unit disk (Shirley & Chiu, JGT 2(3), 1997).
#ifndef LIB_DISK
#define LIB_DISK

#include "lib/circle.glsl"

vec2 concentric_disk(vec2 u) {
    vec2 offset = 2.0 * u - 1.0;
    bool wide = abs(offset.x) > abs(offset.y);
    float radius = wide ? offset.x : offset.y;
    float ratio = radius == 0.0 ? 0.0 : (wide ? offset.y : offset.x) / radius;
    float turn = wide ? 0.125 * ratio : 0.25 - 0.125 * ratio;
    return radius * unit_circle(turn < 0.0 ? turn + 1.0 : turn);
}

#endif
