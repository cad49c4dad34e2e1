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

// A place at the queue's end for each invocation that wants one: one atomic a subgroup. To be called by all invocations.
uint queue_reserve(uint bounce, uint queue, bool wanted) {
    uvec4 ballot = subgroupBallot(wanted);
    uint count = subgroupBallotBitCount(ballot);
    uint base = 0u;
    if (subgroupElect() && count > 0u) {
        uint counter = counter_of(bounce, queue);
        base = atomicAdd(pool.counters.at[counter].count, count);
        atomicMax(pool.counters.at[counter].groups.x, (base + count + gl_WorkGroupSize.x - 1u) / gl_WorkGroupSize.x);
    }
    return subgroupBroadcastFirst(base) + subgroupBallotExclusiveBitCount(ballot);
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
