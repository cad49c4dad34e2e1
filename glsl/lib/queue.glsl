// Appending to and reading from the pool's queues.
#ifndef LIB_QUEUE
#define LIB_QUEUE

#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_ballot : require

#include "layout/film.glsl"

layout(local_size_x_id = 0) in;

uint counter_of(uint bounce, uint queue) {
    return bounce * queue_count() + queue;
}

// Workgroups that take so many invocations.
uint groups_of(uint invocations) {
    return (invocations + gl_WorkGroupSize.x - 1u) / gl_WorkGroupSize.x;
}

shared uint reserved_count;    // by this workgroup
shared uint reserved_base;

// A place at the queue's end for each invocation that wants one. To be called by all invocations of the workgroup, together: all
// that runs asks for the same two words, so that one of a workgroup asks for all of it.
uint queue_reserve(uint bounce, uint queue, bool wanted) {
    uvec4 ballot = subgroupBallot(wanted);
    if (gl_LocalInvocationIndex == 0u) {
        reserved_count = 0u;
    }
    barrier();
    uint before = 0u;
    if (subgroupElect()) {
        before = atomicAdd(reserved_count, subgroupBallotBitCount(ballot));
    }
    barrier();
    if (gl_LocalInvocationIndex == 0u && reserved_count != 0u) {
        uint counter = counter_of(bounce, queue);
        reserved_base = atomicAdd(pool.counters.at[counter].count, reserved_count);
        uint more_groups = groups_of(reserved_base + reserved_count) - groups_of(reserved_base);
        if (more_groups != 0u) {
            atomicAdd(pool.counters.at[counter].groups.x, more_groups);
        }
    }
    barrier();
    return reserved_base + subgroupBroadcastFirst(before) + subgroupBallotExclusiveBitCount(ballot);
}

void queue_push(uint bounce, uint queue, bool wanted, uint slot) {
    uint place = queue_reserve(bounce, queue, wanted);
    if (wanted) {
        pool.queue.at[queue * capacity + place] = slot;
    }
}

uint queue_length(uint bounce, uint queue) {
    return pool.counters.at[counter_of(bounce, queue)].count;
}

uint queue_slot(uint queue, uint place) {
    return pool.queue.at[queue * capacity + place];
}

#endif
