// Appending to and reading from the pool's queues.
#ifndef LIB_QUEUE
#define LIB_QUEUE

#extension GL_EXT_control_flow_attributes : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_ballot : require

#include "layout/film.glsl"

layout(local_size_x_id = 0) in;

// All that runs asks for the same words of a queue: on GPUs one of a workgroup asks for all of it. On CPU drivers one of a subgroup
// does, as a barrier costs more there.
layout(constant_id = 32) const bool RESERVES_BY_WORKGROUP = false;

// Threads of a CPU driver that add to one word wait for one another, each time for as long as a dozen loads. They take workgroups by
// ranges: so there the first half of a dispatch fills a queue from its beginning, and the other half from its end, by a counter of its own.
const bool HAS_TWO_ENDS = !RESERVES_BY_WORKGROUP;

bool is_at_far_end() {
    return HAS_TWO_ENDS && gl_WorkGroupID.x >= gl_NumWorkGroups.x / 2u;
}

// Counters of the far ends stand behind all others.
uint counter_of(uint bounce, uint queue, bool far) {
    return ((far ? max_depth + 1u : 0u) + bounce) * queue_count() + queue;
}

// No queue.
const uint NOWHERE = ~0u;

// More than a bounce has (src/render/pool.rs), and no more than invocations are in a workgroup.
const uint MOST_QUEUES = 32u;
shared uint reserved_count[MOST_QUEUES];    // by this workgroup
shared uint reserved_base[MOST_QUEUES];

// Workgroups that take so many invocations.
uint groups_of(uint invocations) {
    return (invocations + gl_WorkGroupSize.x - 1u) / gl_WorkGroupSize.x;
}

// Makes this workgroup's end of a queue, and the dispatch that takes it, longer by so many; returns its length before.
uint queue_extend(uint bounce, uint queue, uint count) {
    uint base = atomicAdd(pool.counters.at[counter_of(bounce, queue, is_at_far_end())].count, count);
    uint more_groups = groups_of(base + count) - groups_of(base);
    if (more_groups != 0u) {
        atomicAdd(pool.counters.at[counter_of(bounce, queue, false)].groups.x, more_groups);
    }
    return base;
}

// A place in the queue that each invocation names, or of none. `queues` has a bit for each that may be named. To be
// called by all invocations of the workgroup, together.
uint queue_reserve(uint bounce, uint queue, uint queues) {
    uint own = gl_LocalInvocationIndex;
    if (RESERVES_BY_WORKGROUP) {
        if (own < MOST_QUEUES) {
            reserved_count[own] = 0u;
        }
        barrier();
    }
    uint place = 0u;
    [[unroll]] for (uint named = 0u; named < MOST_QUEUES; ++named) {
        if ((queues >> named & 1u) != 0u) {
            uvec4 ballot = subgroupBallot(queue == named);
            uint count = subgroupBallotBitCount(ballot);
            uint base = 0u;
            if (subgroupElect() && count > 0u) {
                if (RESERVES_BY_WORKGROUP) {
                    base = atomicAdd(reserved_count[named], count);
                } else {
                    base = queue_extend(bounce, named, count);
                }
            }
            base = subgroupBroadcastFirst(base);
            place = queue == named ? base + subgroupBallotExclusiveBitCount(ballot) : place;
        }
    }
    if (RESERVES_BY_WORKGROUP) {
        barrier();
        if (own < MOST_QUEUES && reserved_count[own] != 0u) {
            reserved_base[own] = queue_extend(bounce, own, reserved_count[own]);
        }
        barrier();
        place += queue == NOWHERE ? 0u : reserved_base[queue];
    }
    return is_at_far_end() ? capacity - 1u - place : place;
}

void queue_push(uint bounce, uint queue, uint queues, uint slot) {
    uint place = queue_reserve(bounce, queue, queues);
    if (queue != NOWHERE) {
        pool.queue.at[queue * capacity + place] = slot;
    }
}

// What a pass takes: those from the beginning, then those from the end.
struct Queued {
    uint near;      // how many from the beginning
    uint count;     // all
};

Queued queue_of(uint bounce, uint queue) {
    uint near = pool.counters.at[counter_of(bounce, queue, false)].count;
    return Queued(near, near + (HAS_TWO_ENDS ? pool.counters.at[counter_of(bounce, queue, true)].count : 0u));
}

// The place of the n-th.
uint queue_place(Queued queued, uint n) {
    return HAS_TWO_ENDS && n >= queued.near ? capacity - 1u - (n - queued.near) : n;
}

uint queue_slot(uint queue, Queued queued, uint n) {
    return pool.queue.at[queue * capacity + queue_place(queued, n)];
}

#endif
