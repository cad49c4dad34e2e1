// The wavefront's closest hits, by a walk of our own BVH.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "layout/film.glsl"
#include "lib/trace_bvh.glsl"
#include "lib/pass_trace_closest.glsl"

void main() {
    pass_trace_closest();
}
