// Shades the paths that hit a dielectric surface.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "lib/bsdf_dielectric.glsl"
#define FAMILY FAMILY_DIELECTRIC
#include "lib/pass_shade.glsl"

void main() {
    pass_shade();
}
