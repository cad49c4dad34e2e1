// Test of the Vulkan room: follows a chain of nodes in several buffers by their addresses, and sums what they hold.
#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require

layout(local_size_x = 4) in;

layout(buffer_reference) buffer GpuTestNode;
layout(buffer_reference, scalar, buffer_reference_align = 8) buffer GpuTestNode {
    GpuTestNode next;
    uint value;
    uint is_last;
};
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer Words { uint word[]; };

layout(push_constant, scalar) uniform GpuTestChasePush {
    GpuTestNode first;
    Words sum;
} push;

void main() {
    GpuTestNode node = push.first;
    uint sum = node.value;
    while (node.is_last == 0) {
        node = node.next;
        sum += node.value;
    }
    push.sum.word[0] = sum;
}
