// The path pool: one slot a path, as structures of arrays, and the queues that hand slots from pass to pass.
#ifndef LAYOUT_PATH
#define LAYOUT_PATH

#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require

layout(buffer_reference, scalar, buffer_reference_align = 16) buffer Vec4Array {
    vec4 at[];
};
layout(buffer_reference, scalar, buffer_reference_align = 16) buffer UVec4Array {
    uvec4 at[];
};
layout(buffer_reference, scalar, buffer_reference_align = 8) buffer UVec2Array {
    uvec2 at[];
};
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer UIntArray {
    uint at[];
};

// An indirect dispatch, enough for what is queued at both ends, and how many slots are queued at this one.
struct QueueCounter {
    uvec3 groups;
    uint count;
};
layout(buffer_reference, scalar, buffer_reference_align = 16) buffer QueueCounterArray {
    QueueCounter at[];
};

// The queues, and the order of a bounce's counters. Each bounce has counters of its own.
const uint QUEUE_TRACE = 0u;
const uint QUEUE_SHADOW = 1u;
const uint QUEUE_MISS = 2u;
const uint QUEUE_SHADE = 3u; // of the first family of materials that the scene has

// Bit f is set where the scene has a material of family f.
layout(constant_id = 5) const uint FAMILY_MASK = 1u;

// Queues of the family of NeuBRDFs: one a model, so that subgroups evaluate the same one. At least 1.
layout(constant_id = 26) const uint NEUBRDF_QUEUES = 1u;

// The queue of a family, and which of its queues: further ones come last. Families that the scene lacks have none.
uint queue_of_family(uint family, uint part) {
    uint families_before = part == 0u ? FAMILY_MASK & ((1u << family) - 1u) : FAMILY_MASK;
    return QUEUE_SHADE + uint(bitCount(families_before)) + max(part, 1u) - 1u;
}

// Queues of a bounce.
uint queue_count() {
    return QUEUE_SHADE + uint(bitCount(FAMILY_MASK)) + NEUBRDF_QUEUES - 1u;
}

// The arrays themselves; they travel in push constants, since a pointer that is read from memory costs CPU drivers as much as
// what it points to.
struct PathPool {
    Vec4Array origin;            // xyz: ray origin; w: pdf of the BSDF sample that made the ray, 0 where no light sample competes
    Vec4Array direction;         // xyz: unit ray direction; w: by which the path's cone grows, lib/footprint.glsl
    Vec4Array throughput;        // rgb; w: the cone's width at the ray's origin
    Vec4Array radiance;          // rgb: what the path has gathered; w, bits: the normal where it last scattered, lib/light_tree.glsl
    UVec4Array hit_key;          // instance, triangle (and IN_PATCH); SampleKey
    Vec4Array shadow_origin;     // by place in the shadow queue. xyz: origin; w: contribution.r
    Vec4Array shadow_direction;  // xyz: to the light, not normalised, the light being at t = 1 (or infinitely far); w: contribution.g
    UVec2Array shadow_path;      // slot; bits of contribution.b
    UIntArray queue;             // [queue][capacity]: path slots, lib/queue.glsl
    QueueCounterArray counters;  // [near end, far end][max_depth + 1][queue_count()]
};

#endif
