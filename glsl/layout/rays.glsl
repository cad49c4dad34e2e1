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

struct RayHit {
    uint instance;    // NO_HIT where there is nothing; what is below is 0 then, and where any hit would do
    uint triangle;
    float t;
    float u;
    float v;
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
