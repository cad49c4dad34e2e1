#ifndef LIB_EXPONENTIAL_GLSL
#define LIB_EXPONENTIAL_GLSL

// exp(x) - 1 for x >= 0, to a few ulp where it is small too: below 1/2 by its series, above by Vulkan's exp.
vec3 expm1(vec3 x) {
    vec3 series = x * (1.0 + x * (1.0 / 2.0) * (1.0 + x * (1.0 / 3.0) * (1.0 + x * (1.0 / 4.0) * (1.0 + x * (1.0 / 5.0)
        * (1.0 + x * (1.0 / 6.0) * (1.0 + x * (1.0 / 7.0) * (1.0 + x * (1.0 / 8.0))))))));
    return mix(exp(x) - 1.0, series, lessThan(x, vec3(0.5)));
}

#endif
