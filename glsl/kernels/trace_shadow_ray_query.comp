// The wavefront's occlusion of light samples, by VK_KHR_ray_query.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "layout/film.glsl"
#include "lib/trace_ray_query.glsl"
#include "lib/pass_trace_shadow.glsl"

void main() {
    pass_trace_shadow();
}
