// Shades the paths that hit a surface of cloth.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "lib/bsdf_woven.glsl"
#define FAMILY FAMILY_WOVEN
#include "lib/pass_shade.glsl"

void main() {
    pass_shade();
}
