// Adds the queued light samples that nothing occludes to their paths. Included behind a traversal, which defines
// `bool trace_any(vec3 origin, vec3 direction, float t_max)`.
#ifndef LIB_PASS_TRACE_SHADOW
#define LIB_PASS_TRACE_SHADOW

#include "lib/queue.glsl"

void pass_trace_shadow() {
    uint place = gl_GlobalInvocationID.x;
    if (place >= queue_length(bounce, QUEUE_SHADOW)) {
        return;
    }
    vec4 origin = pool.shadow_origin.at[place];
    vec4 direction = pool.shadow_direction.at[place];
    if (!trace_any(origin.xyz, direction.xyz, 1.0)) {
        uvec2 path = pool.shadow_path.at[place];
        pool.radiance.at[path.x].rgb += vec3(origin.w, direction.w, uintBitsToFloat(path.y));
    }
}

#endif
