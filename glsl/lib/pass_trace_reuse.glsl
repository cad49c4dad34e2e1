// What reaches the receivers of a group from its senders: one invocation each pair. Included behind a traversal, which defines
// `bool trace_any(vec3 origin, vec3 direction, float t_max)`.
#ifndef LIB_PASS_TRACE_REUSE
#define LIB_PASS_TRACE_REUSE

#include "lib/hemisphere.glsl"
#include "lib/queue.glsl"
#include "lib/reuse.glsl"

// cos(x) cos(y) / r², where each sees the side of the other that counts.
float reuse_geometry(uint receiver, uint sender, vec3 to_receiver) {
    float squared = dot(to_receiver, to_receiver);
    vec3 direction = to_receiver * inversesqrt(squared);
    float at_receiver = -dot(direction, reuse_field(receiver, RECEIVER_NORMAL).xyz);
    float at_sender = dot(direction, reuse_field(sender, SENDER_GEOMETRIC).xyz);
    bool consistent = -dot(direction, reuse_field(receiver, RECEIVER_GEOMETRIC).xyz) > 0.0
        && dot(direction, reuse_field(sender, SENDER_NORMAL).xyz) >= MIN_COSINE;
    return consistent && at_receiver >= MIN_COSINE && at_sender > 0.0 ? at_receiver * at_sender / squared : 0.0;
}

void pass_trace_reuse() {
    uint pair = gl_GlobalInvocationID.x;
    uint member = pair % REUSE_GROUP;
    uint path = pair / REUSE_GROUP;
    uint place = path / samples_per_pixel;
    uint sample_place = path - place * samples_per_pixel;
    uint sender = reuse_slot(place, sample_place);
    uint receiver = reuse_slot(place / REUSE_GROUP * REUSE_GROUP + member, sample_place);
    bool is_pair = sender != ~0u && receiver != ~0u;
    // All invocations look, and trace: most loads come before control flow begins, and a traversal may need the whole subgroup.
    uint from = sender == ~0u ? 0u : sender;
    uint to = receiver == ~0u ? 0u : receiver;
    if (subgroupBallot(sender != ~0u && reuse_sends(from)) == uvec4(0u)) {
        return;
    }
    vec3 origin = reuse_field(from, SENDER_POINT).xyz;
    vec3 to_receiver = reuse_field(to, RECEIVER_POINT).xyz - origin;
    float transfer = is_pair && reuse_sends(from) ? reuse_geometry(to, from, to_receiver) : 0.0;
    // A receiver sees the sender that its own path found.
    bool occluded = trace_any(origin, to_receiver, transfer > 0.0 && sender != receiver ? 1.0 : -1.0);
    if (sender != ~0u) {
        film.reuse.at[REUSE_TRANSFER * capacity + 2u * sender + member / 4u][member % 4u] = occluded ? 0.0 : transfer;
    }
}

#endif
