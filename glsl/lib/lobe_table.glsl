// Where a BRDF that lib/lobe.glsl samples finds its own data: behind its lobes.
#ifndef LIB_LOBE_TABLE_GLSL
#define LIB_LOBE_TABLE_GLSL

#include "layout/material.glsl"
#include "lib/lobes.glsl"

// The address of what src/render/brdf_table.rs has put behind the lobes; a multiple of 16.
uvec2 lobe_brdf_data(MaterialRecord material) {
    uint carry;
    uint low = uaddCarry(material.table.x, LOBE_BYTES, carry);
    return uvec2(low, material.table.y + carry);
}

#endif
