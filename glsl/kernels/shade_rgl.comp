// Shades the paths that hit a surface with RGL tables.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "lib/bsdf_rgl.glsl"
#define FAMILY FAMILY_RGL
#include "lib/pass_shade.glsl"

void main() {
    pass_shade();
}
