// Evaluates one NBRDF, as eval_neubrdf does a NeuBRDF: the baseline of benches.
#version 460
#extension GL_GOOGLE_include_directive : require

layout(local_size_x_id = 0) in;

#include "layout/evaluation.glsl"
#include "lib/bsdf_nbrdf.glsl"

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i < push.count) {
        NeuBrdfQuery query = push.queries.at[i];
        NeuBrdfValues values;
        brdf_eval_pair(Brdf(push.table), query.wo, query.wi_1, query.wi_2, values.f_1, values.f_2);
        push.results.at[i] = values;
    }
}
