// Shades the paths that hit a surface with a NeuBRDF.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "lib/bsdf_neubrdf.glsl"
#define FAMILY FAMILY_NEUBRDF
#include "lib/pass_shade.glsl"

void main() {
    pass_shade();
}
