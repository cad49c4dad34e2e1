// Test of the Vulkan room: every invocation adds 1; the first also writes the workgroups of a next, indirect dispatch.
#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require

layout(local_size_x_id = 0) in;

layout(buffer_reference, scalar, buffer_reference_align = 4) buffer GpuTestCounters {
    uint invocations;
    uint groups[3];
};

layout(push_constant, scalar) uniform GpuTestCountPush {
    GpuTestCounters counters;
    uint next_groups;
    uint pad;
} push;

void main() {
    atomicAdd(push.counters.invocations, 1);
    if (gl_GlobalInvocationID.x == 0) {
        push.counters.groups = uint[3](push.next_groups, 1, 1);
    }
}
