// Hands what the senders of a group send to its receivers: one invocation a group.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "layout/film.glsl"
#include "lib/reuse.glsl"

layout(local_size_x_id = 0) in;

void main() {
    uint group = gl_GlobalInvocationID.x / samples_per_pixel;
    uint sample_place = gl_GlobalInvocationID.x - group * samples_per_pixel;
    uint first = group * REUSE_GROUP;
    vec3 received[REUSE_GROUP];
    for (uint k = 0u; k < REUSE_GROUP; ++k) {
        received[k] = vec3(0.0);
    }
    for (uint i = 0u; i < REUSE_GROUP; ++i) {
        uint sender = reuse_slot(first + i, sample_place);
        if (sender == ~0u || !reuse_sends(sender)) {
            continue;
        }
        vec4 low = film.reuse.at[REUSE_TRANSFER * capacity + 2u * sender];
        vec4 high = film.reuse.at[REUSE_TRANSFER * capacity + 2u * sender + 1u];
        float transfer[REUSE_GROUP] = float[](low.x, low.y, low.z, low.w, high.x, high.y, high.z, high.w);
        // Where rounding says that the path cannot have gone as it went, what it brings stays with its own pixel.
        bool keeps = transfer[i] == 0.0;
        float sum = dot(low, vec4(1.0)) + dot(high, vec4(1.0));
        vec3 radiance = pool.radiance.at[sender].rgb;
        for (uint k = 0u; k < REUSE_GROUP; ++k) {
            received[k] += radiance * (keeps ? (k == i ? 1.0 : 0.0) : transfer[k] / sum);
        }
    }
    for (uint k = 0u; k < REUSE_GROUP; ++k) {
        uint receiver = reuse_slot(first + k, sample_place);
        if (receiver == ~0u) {
            continue;
        }
        vec4 normal_green = reuse_field(receiver, RECEIVER_NORMAL);
        if (normal_green.xyz == vec3(0.0)) {
            continue;
        }
        vec3 albedo = vec3(reuse_field(receiver, RECEIVER_POINT).w, normal_green.w, reuse_field(receiver, RECEIVER_GEOMETRIC).w);
        vec4 sender = reuse_field(receiver, SENDER_GEOMETRIC);
        vec3 own = pool.radiance.at[receiver].rgb;
        if (sender.xyz != vec3(0.0)) {
            own = vec3(reuse_field(receiver, SENDER_POINT).w, sender.w, reuse_field(receiver, SENDER_NORMAL).w);
        }
        pool.radiance.at[receiver].rgb = own + albedo * received[k];
    }
}
