// From radiance to display, as src/image/tone_map.rs has it.
#ifndef LIB_TONE_MAP
#define LIB_TONE_MAP

// Khronos PBR Neutral (2024) of radiance that is scaled already; still linear. Negative and NaN become 0.
vec3 neutral(vec3 radiance) {
    const float START = 0.8 - 0.04;
    const float DESATURATION = 0.15;
    vec3 color = mix(vec3(0.0), min(radiance, vec3(1.0e6)), greaterThan(radiance, vec3(0.0)));
    float least = min(color.r, min(color.g, color.b));
    color -= least < 0.08 ? least - 6.25 * least * least : 0.04;
    float peak = max(color.r, max(color.g, color.b));
    if (peak < START) {
        return color;
    }
    float range = 1.0 - START;
    float new_peak = 1.0 - range * range / (peak + range - START);
    float whiten = 1.0 - 1.0 / (DESATURATION * (peak - new_peak) + 1.0);
    vec3 scaled = color * (new_peak / peak);
    return scaled + (new_peak - scaled) * whiten;
}

// IEC 61966-2-1 of linear values in [0, 1].
vec3 encode_srgb(vec3 linear) {
    return mix(1.055 * pow(linear, vec3(1.0 / 2.4)) - 0.055, 12.92 * linear, lessThanEqual(linear, vec3(0.0031308)));
}

#endif
