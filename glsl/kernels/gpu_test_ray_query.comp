// Test of the Vulkan room: the nearest hit of each ray, by ray query.
#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_ray_query : require

layout(local_size_x_id = 0) in;
layout(set = 0, binding = 0) uniform accelerationStructureEXT scene;

struct GpuTestRay {
    vec3 origin;
    float t_max;
    vec3 direction;
    uint mask;
};

struct GpuTestHit {
    uint custom_index; // ~0: none
    uint geometry;
    uint triangle;
    float t;
};

layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer GpuTestRays { GpuTestRay ray[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) writeonly buffer GpuTestHits { GpuTestHit hit[]; };

layout(push_constant, scalar) uniform GpuTestRayQueryPush {
    GpuTestRays rays;
    GpuTestHits hits;
    uint count;
    uint pad;
} push;

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= push.count) {
        return;
    }
    GpuTestRay ray = push.rays.ray[i];
    rayQueryEXT query;
    rayQueryInitializeEXT(query, scene, gl_RayFlagsOpaqueEXT, ray.mask, ray.origin, 0.0, ray.direction, ray.t_max);
    while (rayQueryProceedEXT(query)) {}
    GpuTestHit hit = GpuTestHit(~0u, 0, 0, ray.t_max);
    if (rayQueryGetIntersectionTypeEXT(query, true) == gl_RayQueryCommittedIntersectionTriangleEXT) {
        hit.custom_index = rayQueryGetIntersectionInstanceCustomIndexEXT(query, true);
        hit.geometry = rayQueryGetIntersectionGeometryIndexEXT(query, true);
        hit.triangle = rayQueryGetIntersectionPrimitiveIndexEXT(query, true);
        hit.t = rayQueryGetIntersectionTEXT(query, true);
    }
    push.hits.hit[i] = hit;
}
