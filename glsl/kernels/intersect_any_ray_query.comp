// Whether anything is hit of an array of rays, by VK_KHR_ray_query: for tests and benches.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "layout/rays.glsl"
#include "lib/trace_ray_query.glsl"
#include "lib/pass_intersect.glsl"

void main() {
    pass_intersect_any();
}
