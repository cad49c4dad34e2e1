// Evaluates one NeuBRDF at places, for pairs of light directions in an array: what tests and benches run.
#version 460
#extension GL_GOOGLE_include_directive : require

layout(local_size_x_id = 0) in;

#include "layout/evaluation.glsl"
#include "lib/neubrdf_by_address.glsl"

void main() {
    // All invocations evaluate, those beyond the end the last query once more.
    uint i = gl_GlobalInvocationID.x;
    NeuBrdfQuery query = push.queries.at[min(i, push.count - 1u)];
    NeuBrdfValues values;
    neubrdf_eval_pair(push.table, NeuBrdfPlace(query.uv, query.area), query.wo, query.wi_1, query.wi_2, values.f_1, values.f_2);
    if (i < push.count) {
        push.results.at[i] = values;
    }
}
