// The material alone, as src/export translates it: lib/neubrdf_by_buffer.glsl, and a kernel that answers queries.
#version 450
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 64) in;

#include "lib/neubrdf_by_buffer.glsl"

struct ExportedQuery {
    vec3 wo;
    uint model;
    vec3 wi;
    uint padding_0;
    vec3 u;
    uint padding_1;
};

struct ExportedAnswer {
    vec3 f;             // of wo and wi
    float pdf;
    vec3 sampled_wi;    // for wo and u
    float sampled_pdf;
};

layout(std430, set = NEUBRDF_SET, binding = NEUBRDF_BINDING + 1) readonly buffer NeuBrdfQueries {
    uint count;
    uint padding[3];
    ExportedQuery at[];
} neubrdf_queries;

layout(std430, set = NEUBRDF_SET, binding = NEUBRDF_BINDING + 2) writeonly buffer NeuBrdfAnswers {
    ExportedAnswer at[];
} neubrdf_answers;

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= neubrdf_queries.count) {
        return;
    }
    ExportedQuery query = neubrdf_queries.at[i];
    NeuBrdfSample picked = neubrdf_sample(query.model, query.wo, query.u);
    neubrdf_answers.at[i].f = neubrdf_eval(query.model, query.wo, query.wi);
    neubrdf_answers.at[i].pdf = neubrdf_pdf(query.model, query.wo, query.wi);
    neubrdf_answers.at[i].sampled_wi = picked.wi;
    neubrdf_answers.at[i].sampled_pdf = picked.pdf;
}
