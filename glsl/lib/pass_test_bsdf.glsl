// Test of a family's BSDF: evaluates and samples it for given directions. Included behind the family's BSDF.
#ifndef LIB_PASS_TEST_BSDF
#define LIB_PASS_TEST_BSDF

#include "lib/bsdf.glsl"

struct BsdfTestCase {
    vec3 wo;
    uint material;
    vec3 wi;
    uint pad;
    vec3 u;
    uint pad_2;
};

struct BsdfTestResult {
    vec4 eval_pdf;   // for wo and wi
    vec3 wi;         // sampled with u
    float pdf;
    vec3 weight;
    uint is_delta;   // bit 0: of the sample, bit 1: of the whole BSDF
};

layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer MaterialRecords { MaterialRecord at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer BsdfTestCases { BsdfTestCase at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) writeonly buffer BsdfTestResults { BsdfTestResult at[]; };

layout(push_constant, scalar) uniform BsdfTestPush {
    MaterialRecords materials;
    BsdfTestCases cases;
    BsdfTestResults results;
    uint count;
    uint pad;
} push;

void pass_test_bsdf() {
    // All invocations evaluate, those beyond the end the last case once more: families may need the whole subgroup.
    uint i = gl_GlobalInvocationID.x;
    BsdfTestCase test = push.cases.at[min(i, push.count - 1u)];
    MaterialRecord material = push.materials.at[test.material];
    Bsdf bsdf = bsdf_make(material, material.color);
#ifdef BSDF_PICKS_FIRST
    vec4 picked = bsdf_pick(bsdf, test.wo, test.u);
    vec4 eval_pdf;
    vec3 f_picked;
    bsdf_eval_pair(bsdf, test.wo, test.wi, picked.xyz, eval_pdf, f_picked);
    BsdfSample next = bsdf_picked(picked, f_picked);
#else
    vec4 eval_pdf = bsdf_eval_pdf(bsdf, test.wo, test.wi);
    BsdfSample next = bsdf_sample(bsdf, test.wo, test.u);
#endif
    uint is_delta = uint(next.is_delta) + 2u * uint(bsdf_is_delta(bsdf));
    if (i < push.count) {
        push.results.at[i] = BsdfTestResult(eval_pdf, next.wi, next.pdf, next.weight, is_delta);
    }
}

#endif
