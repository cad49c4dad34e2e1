// Whether anything is hit of an array of rays, by our own BVH: for tests and benches.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "layout/rays.glsl"
#include "lib/trace_bvh.glsl"
#include "lib/pass_intersect.glsl"

void main() {
    pass_intersect_any();
}
