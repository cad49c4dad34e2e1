// Finds the first hit of each queued path and hands it to the family of materials that it hit. Included behind a traversal,
// which defines `Hit trace_closest(vec3 origin, vec3 direction, float t_max)`.
#ifndef LIB_PASS_TRACE_CLOSEST
#define LIB_PASS_TRACE_CLOSEST

#include "lib/light.glsl"
#include "lib/patches.glsl"
#include "lib/queue.glsl"

const bool ONE_FAMILY = (FAMILY_MASK & (FAMILY_MASK - 1u)) == 0u;

void pass_trace_closest() {
    uint n = gl_GlobalInvocationID.x;
    Queued queued = queue_of(bounce, QUEUE_TRACE);
    bool has_path = n < (bounce == 0u ? pixel_count * samples_per_pixel : queued.count);
    uint slot = has_path && bounce != 0u ? queue_slot(QUEUE_TRACE, queued, n) : has_path ? n : 0u;
    // All invocations trace: a traversal may need the whole subgroup. A ray that ends before it starts meets nothing.
    vec3 origin = pool.origin.at[slot].xyz;
    vec3 direction = pool.direction.at[slot].xyz;
    Hit hit = trace_closest(origin, direction, has_path ? INFINITY : -1.0);
    if (hit.instance != NO_HIT && is_in_patch(scene, hit, origin, direction)) {
        hit.triangle |= IN_PATCH;
    }
    if (has_path) {
        pool.hit_key.at[slot].xy = uvec2(hit.instance, hit.triangle);
    }
    uint queue = has_path && HAS_ENVIRONMENT ? QUEUE_MISS : NOWHERE;
    if (hit.instance != NO_HIT) {
        MeshRecord mesh = MeshRecord(scene.meshes.at[scene.instances.at[hit.instance].mesh]);
        uint family = uint(findLSB(FAMILY_MASK));
        uint part = 0u;
        if (!ONE_FAMILY || NEUBRDF_QUEUES > 1u) {
            uint flags = scene.materials.at[material_of_hit(scene, mesh, hit.triangle)].flags;
            family = material_family(flags);
            part = flags >> MATERIAL_PART_SHIFT;
        }
        queue = queue_of_family(family, part);
    }
    uint queues = (1u << queue_count()) - (HAS_ENVIRONMENT ? 1u << QUEUE_MISS : 1u << QUEUE_SHADE);
    queue_push(bounce, queue, queues, slot);
}

#endif
