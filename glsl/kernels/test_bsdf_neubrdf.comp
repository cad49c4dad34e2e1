// Test of lib/bsdf_neubrdf.glsl.
#version 460
#extension GL_GOOGLE_include_directive : require

layout(local_size_x_id = 0) in;

#include "lib/bsdf_neubrdf.glsl"
#include "lib/pass_test_bsdf.glsl"

void main() {
    pass_test_bsdf();
}
