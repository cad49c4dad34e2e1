// Push constants of the kernel that gathers a host's meshes.
#ifndef LAYOUT_GATHER
#define LAYOUT_GATHER

#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_EXT_scalar_block_layout : require

layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer SourceArray { uint at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) writeonly buffer TargetArray { uint at[]; };

layout(push_constant, scalar) uniform GatherPass {
    SourceArray source;
    TargetArray target;
    uint count;         // words to write
    uint components;    // words of an element, side by side
    uint stride;        // words from an element to the next; 0 where the source holds numbers of 16 bits, side by side
    uint first;         // of those, the first
    uint most;          // larger words become it
    uint padding;
};

#endif
