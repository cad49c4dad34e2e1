// Test of the Vulkan room: follows a chain of nodes in several buffers by their addresses, and sums what they hold.
#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference_uvec2 : require
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
    // Carried from turn to turn as two words: SwiftShader crashes on an address that a loop assigns and reads again in
    // its next turn. Addresses that a loop only reads, or loads anew in each turn, are fine.
    uvec2 node = uvec2(push.first);
    uint sum = 0;
    bool is_last = false;
    while (!is_last) {
        sum += GpuTestNode(node).value;
        is_last = GpuTestNode(node).is_last != 0;
        node = uvec2(GpuTestNode(node).next);
    }
    push.sum.word[0] = sum;
}
