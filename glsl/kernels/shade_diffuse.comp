// Shades the paths that hit a diffuse surface.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "lib/bsdf_diffuse.glsl"
#define FAMILY FAMILY_DIFFUSE
#include "lib/pass_shade.glsl"

void main() {
    pass_shade();
}
