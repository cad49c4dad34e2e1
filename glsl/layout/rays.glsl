// Rays in an array: what the intersect_* kernels of tests and benches read and write.
#ifndef LAYOUT_RAYS
#define LAYOUT_RAYS

#include "layout/scene.glsl"

struct Ray {
    vec3 origin;
    float t_max;
    vec3 direction;
    float padding;
};
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer RayArray { Ray at[]; };

// What it met. Where any hit would do there is no telling which.
struct RayHit {
    uint instance;    // NO_HIT where there is nothing
    uint triangle;
};
layout(buffer_reference, scalar, buffer_reference_align = 4) writeonly buffer RayHitArray { RayHit at[]; };

layout(push_constant, scalar) uniform RayPass {
    SceneTable scene;
    RayArray rays;
    RayHitArray hits;
    uint count;
    uint padding;
};

layout(local_size_x_id = 0) in;

#endif
