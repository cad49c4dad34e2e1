// NeuBRDFs as a family of materials.
#ifndef LIB_BSDF_NEUBRDF_GLSL
#define LIB_BSDF_NEUBRDF_GLSL

#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_EXT_control_flow_attributes : require

#include "lib/bsdf.glsl"
#include "lib/lobe_table.glsl"
#include "lib/neubrdf_by_address.glsl"

struct Brdf {
    uvec2 table;    // a NeuBrdfTable
    NeuBrdfPlace place;
};

Brdf brdf_make(MaterialRecord material) {
    return Brdf(lobe_brdf_data(material), NEUBRDF_WHOLE);
}

void brdf_eval_pair(Brdf b, vec3 wo, vec3 wi_1, vec3 wi_2, out vec3 f_1, out vec3 f_2) {
    f_1 = f_2 = vec3(0.0);
    // One model after another, by all invocations, since they share the loading of its weights.
    bool is_done = false;
    [[dont_unroll]] for (;;) {
        uvec4 open = subgroupBallot(!is_done);
        if (open == uvec4(0u)) {
            break;
        }
        uvec2 table = subgroupShuffle(b.table, subgroupBallotFindLSB(open));
        vec3 value_1, value_2;
        neubrdf_eval_pair(table, b.place, wo, wi_1, wi_2, value_1, value_2);
        if (!is_done && table == b.table) {
            f_1 = value_1;
            f_2 = value_2;
            is_done = true;
        }
    }
}

#include "lib/lobe.glsl"

#define BSDF_HAS_PLACE

// At texture coordinates, and how much about them.
void bsdf_look_at(inout Bsdf b, vec2 uv, float area) {
    b.brdf.place = NeuBrdfPlace(uv, area);
}

#endif
