#ifndef LIB_HALF_ANGLE
#define LIB_HALF_ANGLE

// Directions that cancel to less than this have none.
const float LEAST_DIRECTION = 1e-3;

// (cos ψ, sin ψ) of a multiple of (cos 2ψ, sin 2ψ), with ψ in (-π/2, π/2], and 0 where that has no direction:
// src/material/surface_frame.rs.
vec2 half_angle(vec2 doubled) {
    float size = length(doubled);
    doubled = size < LEAST_DIRECTION ? vec2(1.0, 0.0) : doubled / size;
    // By the one of two formulas in which nothing cancels.
    vec2 turn = normalize(doubled.x >= 0.0 ? vec2(1.0 + doubled.x, doubled.y) : vec2(abs(doubled.y), 1.0 - doubled.x));
    turn.y = doubled.x < 0.0 && doubled.y < 0.0 ? -turn.y : turn.y;
    return turn;
}

#endif
