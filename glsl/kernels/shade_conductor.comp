// Shades the paths that hit a conductor surface.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "lib/bsdf_conductor.glsl"
#define FAMILY FAMILY_CONDUCTOR
#include "lib/pass_shade.glsl"

void main() {
    pass_shade();
}
