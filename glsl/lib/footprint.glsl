// How much of a surface a path sees at a vertex: a cone about each of its rays. Definition: src/material/footprint.rs.
#ifndef LIB_FOOTPRINT
#define LIB_FOOTPRINT

#include "layout/film.glsl"
#include "lib/surface.glsl"

// Some material varies over a texture otherwise than by a colour.
layout(constant_id = 29) const bool HAS_FOOTPRINTS = false;

struct Cone {
    float width;     // where the ray starts
    float spread;    // by which it grows with the distance
};

// As wide as a pixel at any distance.
Cone camera_cone(vec3 direction) {
    return Cone(0.0, length(film.camera.right) * dot(film.camera.axis, direction));
}

// The cone of the ray that hit the surface, there.
Cone cone_at(Cone cone, Surface surface) {
    return Cone(cone.width + cone.spread * sqrt(surface.distance_squared), cone.spread);
}

// The area in texture coordinates that a cone cuts out of the surface.
float cone_area(Cone cone, Surface surface, vec3 direction) {
    float cosine = max(abs(dot(direction, surface.front)), 1e-3);
    return cone.width * cone.width / cosine * surface.uv_density;
}

// Beyond the surface, along a direction that was picked with density `pdf`: never narrower than before, and a sixteenth of the directions that
// such a density stands for.
Cone cone_scattered(Cone cone, float pdf, bool is_delta) {
    return Cone(cone.width, is_delta ? cone.spread : max(cone.spread, 0.25 * inversesqrt(pdf)));
}

#endif
