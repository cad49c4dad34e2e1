// Shades the paths that hit a coated surface.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "lib/bsdf_coated.glsl"
#define FAMILY FAMILY_COATED
#include "lib/pass_shade.glsl"

void main() {
    pass_shade();
}
