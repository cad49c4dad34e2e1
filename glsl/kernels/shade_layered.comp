// Shades the paths that hit a surface with layers.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "lib/bsdf_layered.glsl"
#define FAMILY FAMILY_LAYERED
#include "lib/pass_shade.glsl"

void main() {
    pass_shade();
}
