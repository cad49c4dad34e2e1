// Where rays leave a surface: just outside the box that the rounding error of the hit point spans (pbrt-v4, section 6.8.6).
#ifndef LIB_OFFSET
#define LIB_OFFSET

// The next float up or down, as `sign` says.
float next_float(float value, float sign) {
    int bits = floatBitsToInt(value);
    if (value == 0.0) {
        return sign < 0.0 ? -1.4e-45 : 1.4e-45;
    }
    bool up = sign > 0.0;
    return intBitsToFloat((value > 0.0) == up ? bits + 1 : bits - 1);
}

vec3 offset_origin(vec3 position, vec3 position_error, vec3 normal, vec3 direction) {
    float reach = dot(abs(normal), position_error);
    vec3 offset = dot(direction, normal) < 0.0 ? -reach * normal : reach * normal;
    precise vec3 origin = position + offset;
    // The sum rounds: one more step in the offset's direction.
    return vec3(
        offset.x != 0.0 ? next_float(origin.x, offset.x) : origin.x,
        offset.y != 0.0 ? next_float(origin.y, offset.y) : origin.y,
        offset.z != 0.0 ? next_float(origin.z, offset.z) : origin.z
    );
}

#endif
