// Shades the paths that hit a surface known by samples.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "lib/bsdf_sparse.glsl"
#define FAMILY FAMILY_SPARSE
#include "lib/pass_shade.glsl"

void main() {
    pass_shade();
}
