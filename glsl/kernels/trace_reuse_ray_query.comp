// Which receivers see which senders of their group, by VK_KHR_ray_query.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "layout/film.glsl"
#include "lib/trace_ray_query.glsl"
#include "lib/pass_trace_reuse.glsl"

void main() {
    pass_trace_reuse();
}
