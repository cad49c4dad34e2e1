// Where rays leave a surface: just off the ball that the rounding error of the hit point spans.
//
// pbrt-v4 (section 6.8.6) goes by the error along the normal alone. On a plane y = 0 that is nothing, and yet the next ray's
// t for that plane is only as exact as the numbers that go into it; so the largest of the three errors counts, twice.
#ifndef LIB_OFFSET
#define LIB_OFFSET

// The next float up or down, as `sign` says.
float next_float(float value, float sign) {
    int bits = floatBitsToInt(value);
    return intBitsToFloat((value > 0.0) == (sign > 0.0) ? bits + 1 : bits - 1);
}

vec3 offset_origin(vec3 position, vec3 position_error, vec3 normal, vec3 direction) {
    float reach = 2.0 * max(position_error.x, max(position_error.y, position_error.z));
    vec3 offset = dot(direction, normal) < 0.0 ? -reach * normal : reach * normal;
    precise vec3 origin = position + offset;
    // The sum rounds: one more step in the offset's direction.
    return vec3(
        offset.x * origin.x != 0.0 ? next_float(origin.x, offset.x) : origin.x,
        offset.y * origin.y != 0.0 ? next_float(origin.y, offset.y) : origin.y,
        offset.z * origin.z != 0.0 ? next_float(origin.z, offset.z) : origin.z
    );
}

#endif
