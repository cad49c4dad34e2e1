// Shades the paths that hit a surface with a MERL table.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "lib/bsdf_merl.glsl"
#define FAMILY FAMILY_MERL
#include "lib/pass_shade.glsl"

void main() {
    pass_shade();
}
