// A table by half and difference angle: src/material/merl.rs.
#ifndef LIB_BSDF_MERL_GLSL
#define LIB_BSDF_MERL_GLSL

#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_EXT_control_flow_attributes : require
#extension GL_EXT_scalar_block_layout : require

#include "lib/bsdf.glsl"
#include "lib/half_difference.glsl"
#include "lib/lobe_table.glsl"

// Cells over θh, θd and φd.
const uvec3 MERL_SIZE = uvec3(90u, 90u, 180u);

// θh slowest, φd fastest.
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer MerlTable {
    vec3 value[];
};

struct Brdf {
    uvec2 table;    // a MerlTable
};

Brdf brdf_make(MaterialRecord material) {
    return Brdf(lobe_brdf_data(material));
}

#define BRDF_EVAL_ONE
vec3 brdf_eval(Brdf b, vec3 wo, vec3 wi) {
    MerlTable table = MerlTable(b.table);
    HalfDifference pair = half_difference(wo, wi);
    vec2 angles = vec2(sqrt(half_angle(pair)), difference_angle(pair));
    vec2 position = clamp(angles * vec2(MERL_SIZE.xy) - 0.5, vec2(0.0), vec2(MERL_SIZE.xy) - 1.0);
    uvec2 cell = min(uvec2(position), MERL_SIZE.xy - 2u);
    vec2 part = position - vec2(cell);
    float turned = difference_azimuth(pair) * float(MERL_SIZE.z) + (float(MERL_SIZE.z) - 0.5);
    float around = floor(turned);
    uint azimuth_0 = uint(around) % MERL_SIZE.z;
    uint azimuth_1 = (azimuth_0 + 1u) % MERL_SIZE.z;
    float turned_part = turned - around;

    vec3 sum = vec3(0.0);
    [[unroll]] for (uint corner = 0u; corner < 8u; ++corner) {
        uvec3 side = uvec3(corner >> 2u, (corner >> 1u) & 1u, corner & 1u);
        vec3 weights = mix(1.0 - vec3(part, turned_part), vec3(part, turned_part), bvec3(side));
        uint row = (cell.x + side.x) * MERL_SIZE.y + cell.y + side.y;
        vec3 value = table.value[row * MERL_SIZE.z + (side.z == 0u ? azimuth_0 : azimuth_1)];
        sum += weights.x * weights.y * weights.z * value;
    }
    return sum;
}

#include "lib/lobe.glsl"

#endif
