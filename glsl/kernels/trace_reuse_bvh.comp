// Which receivers see which senders of their group, by a walk of our own BVH.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "layout/film.glsl"
#include "lib/trace_bvh.glsl"
#include "lib/pass_trace_reuse.glsl"

void main() {
    pass_trace_reuse();
}
