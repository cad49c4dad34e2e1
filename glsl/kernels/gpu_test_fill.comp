// Test of the Vulkan room: writes i * factor + bias to the i-th word, through a buffer device address.
#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const uint factor = 1;
layout(constant_id = 2) const uint bias = 0;

layout(buffer_reference, scalar, buffer_reference_align = 4) buffer Words { uint word[]; };

layout(push_constant, scalar) uniform GpuTestFillPush {
    Words words;
    uint count;
    uint pad;
} push;

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i < push.count) {
        push.words.word[i] = i * factor + bias;
    }
}
