// Adds the queued light samples that nothing occludes to their paths. Included behind a traversal, which defines
// `bool trace_any(vec3 origin, vec3 direction, float t_max)`.
#ifndef LIB_PASS_TRACE_SHADOW
#define LIB_PASS_TRACE_SHADOW

#include "lib/queue.glsl"

void pass_trace_shadow() {
    // All invocations trace: a traversal may need the whole subgroup. A ray that ends before it starts meets nothing.
    Queued queued = queue_of(bounce, QUEUE_SHADOW);
    bool has_ray = gl_GlobalInvocationID.x < queued.count;
    uint place = has_ray ? queue_place(queued, gl_GlobalInvocationID.x) : 0u;
    vec4 origin = pool.shadow_origin.at[place];
    vec4 direction = pool.shadow_direction.at[place];
    bool occluded = trace_any(origin.xyz, direction.xyz, has_ray ? 1.0 : -1.0);
    if (has_ray && !occluded) {
        uvec2 path = pool.shadow_path.at[place];
        pool.radiance.at[path.x].rgb += vec3(origin.w, direction.w, uintBitsToFloat(path.y));
    }
}

#endif
