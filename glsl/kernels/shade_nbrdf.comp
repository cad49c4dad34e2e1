// Shades the paths that hit a surface with an NBRDF.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "lib/bsdf_nbrdf.glsl"
#define FAMILY FAMILY_NBRDF
#include "lib/pass_shade.glsl"

void main() {
    pass_shade();
}
