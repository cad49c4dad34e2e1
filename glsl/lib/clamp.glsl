// A limit on indirect light: it ends fireflies, and is biased. Off unless asked for.
#ifndef LIB_CLAMP
#define LIB_CLAMP

layout(constant_id = 35) const float CLAMP_INDIRECT = 0.0;   // 0: none

// What a path of so many segments brings along. Light that is seen (1 segment) or falls on what is seen (2) is left as it is.
vec3 clamp_indirect(vec3 contribution, uint segments) {
    if (CLAMP_INDIRECT == 0.0 || segments <= 2u) {
        return contribution;
    }
    float largest = max(contribution.r, max(contribution.g, contribution.b));
    return largest > CLAMP_INDIRECT ? contribution * (CLAMP_INDIRECT / largest) : contribution;
}

#endif
