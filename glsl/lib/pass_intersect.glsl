// Traces an array of rays. Included behind a traversal.
#ifndef LIB_PASS_INTERSECT
#define LIB_PASS_INTERSECT

#include "lib/triangle.glsl"

// The ray of this invocation; one that misses everything where there are no more.
Ray own_ray() {
    Ray ray = rays.at[min(gl_GlobalInvocationID.x, count - 1u)];
    ray.t_max = gl_GlobalInvocationID.x < count ? ray.t_max : -1.0;
    return ray;
}

void pass_intersect_closest() {
    Ray ray = own_ray();
    Hit hit = trace_closest(ray.origin, ray.direction, ray.t_max);
    RayHit result = RayHit(hit.instance, 0u, 0.0, 0.0, 0.0);
    if (hit.instance != NO_HIT) {
        InstanceRecord instance = scene.instances.at[hit.instance];
        MeshRecord mesh = MeshRecord(scene.meshes.at[instance.mesh]);
        uvec3 corners = mesh.indices.at[hit.triangle];
        if (INSTANCED) {
            ray.origin = instance.world_to_object * vec4(ray.origin, 1.0);
            ray.direction = mat3(instance.world_to_object) * ray.direction;
        }
        result.triangle = hit.triangle;
        intersect_triangle(ray.origin, ray.direction, 0.0, INFINITY, mesh.positions.at[corners.x],
                           mesh.positions.at[corners.y], mesh.positions.at[corners.z], result.t, result.u, result.v);
    }
    if (gl_GlobalInvocationID.x < count) {
        hits.at[gl_GlobalInvocationID.x] = result;
    }
}

void pass_intersect_any() {
    Ray ray = own_ray();
    bool is_hit = trace_any(ray.origin, ray.direction, ray.t_max);
    if (gl_GlobalInvocationID.x < count) {
        hits.at[gl_GlobalInvocationID.x] = RayHit(is_hit ? 0u : NO_HIT, 0u, 0.0, 0.0, 0.0);
    }
}

#endif
