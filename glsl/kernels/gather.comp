// Gathers an attribute or the indices of a host's mesh into words side by side, as our own meshes have them.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "layout/gather.glsl"

layout(local_size_x_id = 0) in;

uint word(uint index) {
    if (stride == 0u) {
        uint place = first + index;
        return source.at[place / 2u] >> (16u * (place % 2u)) & 0xffffu;
    }
    return source.at[index / components * stride + index % components];
}

void main() {
    uint step = gl_NumWorkGroups.x * gl_WorkGroupSize.x;
    for (uint index = gl_GlobalInvocationID.x; index < count; index += step) {
        target.at[index] = min(word(index), most);
    }
}
