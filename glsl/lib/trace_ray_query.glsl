// Finds triangles by VK_KHR_ray_query. The same interface as lib/trace_bvh.glsl; included behind a declaration of `scene`, too.
#ifndef LIB_TRACE_RAY_QUERY
#define LIB_TRACE_RAY_QUERY

#extension GL_EXT_ray_query : require

#include "layout/geometry.glsl"
#include "lib/opacity.glsl"

layout(set = 0, binding = 0) uniform accelerationStructureEXT top_level;

// Without holes all triangles are opaque, whatever the structures say; with them those of the instances that have some are asked for.
const uint OPAQUENESS = HAS_HOLES ? 0u : gl_RayFlagsOpaqueEXT;

// Goes on until all that may count has been seen.
void proceed(rayQueryEXT query, vec3 origin, vec3 direction) {
    while (rayQueryProceedEXT(query)) {
        if (HAS_HOLES) {
            Hit hit = Hit(uint(rayQueryGetIntersectionInstanceCustomIndexEXT(query, false)),
                          uint(rayQueryGetIntersectionPrimitiveIndexEXT(query, false)));
            if (!goes_through(scene, hit, origin, direction)) {
                rayQueryConfirmIntersectionEXT(query);
            }
        }
    }
}

// The nearest triangle with 0 < t < t_max; a ray with t_max < 0 meets nothing.
Hit trace_closest(vec3 origin, vec3 direction, float t_max) {
    Hit hit = Hit(NO_HIT, 0u);
    if (t_max >= 0.0) {
        rayQueryEXT query;
        rayQueryInitializeEXT(query, top_level, OPAQUENESS, 0xffu, origin, 0.0, direction, t_max);
        proceed(query, origin, direction);
        if (rayQueryGetIntersectionTypeEXT(query, true) == gl_RayQueryCommittedIntersectionTriangleEXT) {
            hit.instance = rayQueryGetIntersectionInstanceCustomIndexEXT(query, true);
            hit.triangle = rayQueryGetIntersectionPrimitiveIndexEXT(query, true);
        }
    }
    return hit;
}

// Whether any triangle has 0 < t < t_max.
bool trace_any(vec3 origin, vec3 direction, float t_max) {
    bool found = false;
    if (t_max >= 0.0) {
        rayQueryEXT query;
        uint flags = OPAQUENESS | gl_RayFlagsTerminateOnFirstHitEXT;
        rayQueryInitializeEXT(query, top_level, flags, 0xffu, origin, 0.0, direction, t_max);
        proceed(query, origin, direction);
        found = rayQueryGetIntersectionTypeEXT(query, true) == gl_RayQueryCommittedIntersectionTriangleEXT;
    }
    return found;
}

#endif
