// Fresnel reflectance: src/material/fresnel.rs.
#ifndef LIB_FRESNEL_GLSL
#define LIB_FRESNEL_GLSL

// η cos θt for a boundary with η² - 1 = `excess`; 0 where reflection is total.
float fresnel_refracted(float cosine, float excess) {
    return sqrt(max(excess + cosine * cosine, 0.0));
}

// Reflectance (x) and transmittance (y) between dielectrics, with `refracted` = fresnel_refracted(cosine, excess). Each is free
// of cancellation: the numerators cos θ - η cos θt and η cos θ - cos θt, which vanish as η nears 1, are expanded by their
// conjugates; the transmittance, which vanishes at grazing angles, is not taken as 1 - reflectance.
vec2 fresnel_dielectric(float cosine, float refracted, float excess) {
    float across = cosine + refracted;
    float along = (1.0 + excess) * cosine + refracted;
    float across_2 = 1.0 / (across * across);
    float along_2 = 1.0 / (along * along);
    float perpendicular = excess * across_2;
    float parallel = excess * ((2.0 + excess) * cosine * cosine - 1.0) * along_2;
    float reflectance = 0.5 * (perpendicular * perpendicular + parallel * parallel);
    float transmittance = 2.0 * cosine * refracted * (across_2 + (1.0 + excess) * along_2);
    return refracted > 0.0 ? min(vec2(reflectance, transmittance), 1.0) : vec2(1.0, 0.0);
}

vec2 fresnel_dielectric(float cosine, float excess) {
    return fresnel_dielectric(cosine, fresnel_refracted(cosine, excess), excess);
}

// Reflectance of a metal. Real form of the complex equations: Lagarde, "Memo on Fresnel equations", 2013.
vec3 fresnel_complex(float cosine, vec3 eta, vec3 kappa) {
    float cosine2 = cosine * cosine;
    float sine2 = 1.0 - cosine2;
    vec3 real = eta * eta - kappa * kappa - sine2;
    vec3 cross_term = 4.0 * eta * eta * kappa * kappa;
    vec3 modulus = sqrt(real * real + cross_term);
    // (modulus + real) / 2, without cancellation where real < 0.
    vec3 larger = modulus + abs(real);
    vec3 square = mix(0.5 * larger, 0.5 * cross_term / max(larger, 1e-30), lessThan(real, vec3(0.0)));
    vec3 sum = modulus + cosine2;
    vec3 mixed = 2.0 * cosine * sqrt(square);
    vec3 perpendicular = (sum - mixed) / max(sum + mixed, 1e-30);
    vec3 sum_p = cosine2 * modulus + sine2 * sine2;
    vec3 mixed_p = mixed * sine2;
    vec3 parallel = perpendicular * (sum_p - mixed_p) / max(sum_p + mixed_p, 1e-30);
    return clamp(0.5 * (perpendicular + parallel), 0.0, 1.0);
}

vec3 fresnel_schlick(float cosine, vec3 f0) {
    float away = 1.0 - cosine;
    float away2 = away * away;
    return f0 + (1.0 - f0) * (away2 * away2 * away);
}

#endif
