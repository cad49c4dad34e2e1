// Traces an array of rays. Included behind a traversal.
#ifndef LIB_PASS_INTERSECT
#define LIB_PASS_INTERSECT

// The ray of this invocation; one that misses everything where there are no more.
Ray own_ray() {
    Ray ray = rays.at[min(gl_GlobalInvocationID.x, count - 1u)];
    ray.t_max = gl_GlobalInvocationID.x < count ? ray.t_max : -1.0;
    return ray;
}

void pass_intersect_closest() {
    Ray ray = own_ray();
    Hit hit = trace_closest(ray.origin, ray.direction, ray.t_max);
    if (gl_GlobalInvocationID.x < count) {
        hits.at[gl_GlobalInvocationID.x] = RayHit(hit.instance, hit.triangle);
    }
}

void pass_intersect_any() {
    Ray ray = own_ray();
    bool is_hit = trace_any(ray.origin, ray.direction, ray.t_max);
    if (gl_GlobalInvocationID.x < count) {
        hits.at[gl_GlobalInvocationID.x] = RayHit(is_hit ? 0u : NO_HIT, 0u);
    }
}

#endif
