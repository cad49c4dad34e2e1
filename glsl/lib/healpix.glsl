// The grid of corners of HEALPix pixels over the upper hemisphere: src/scene/brdf/sphere_grid.rs, which explains it.
#ifndef LIB_HEALPIX_GLSL
#define LIB_HEALPIX_GLSL

#include "lib/circle.glsl"

// A direction whose x and y are both smaller than this is the pole. (Their squares still are normal numbers.)
const float POLE = 1e-18;

// A square of the lattice and a place in it.
struct SphereCell {
    uint quadrant;
    uint i;       // steps of its poleward corner from the pole, eastwards
    uint j;       // and westwards
    uint size;    // steps to a side
    vec2 uv;
};

// The four corners and how they count bilinearly; the fourth one of a triangle at the equator does not.
struct SphereCorners {
    uvec4 points;
    vec4 weights;
};

SphereCell sphere_cell(uint n_side, vec3 w) {
    SphereCell cell;
    // The quadrant, and (x, y) turned back into the first one.
    vec2 flat_w = w.y >= 0.0 ? (w.x >= 0.0 ? w.xy : vec2(w.y, -w.x)) : (w.x < 0.0 ? -w.xy : vec2(-w.y, w.x));
    cell.quadrant = w.y >= 0.0 ? (w.x >= 0.0 ? 0u : 1u) : (w.x < 0.0 ? 2u : 3u);
    if (max(flat_w.x, flat_w.y) < POLE) {
        cell.quadrant = 0u;
        flat_w = vec2(0.0);
    }
    float z = clamp(w.z, 0.0, 1.0);
    float polar = length(flat_w) * sqrt(3.0 / (1.0 + z));
    float tau = min(4.0 * turn_of(flat_w.y, flat_w.x), 1.0);
    vec2 azimuth = vec2(tau, 1.0 - tau);
    vec2 place = (polar < 1.0 ? azimuth * polar : azimuth + (0.5 - 0.75 * min(z, 2.0 / 3.0))) * float(n_side);
    // A point of the equator belongs to pixels to the north of it. Clamped as integers too: no input leads out of the grid.
    vec2 corner = floor(place);
    cell.i = min(uint(max(corner.x, 0.0)), 2u * n_side - 1u);
    cell.j = min(uint(max(corner.y, 0.0)), 2u * n_side - 1u - cell.i);
    cell.size = 1u;
    cell.uv = clamp(place - vec2(cell.i, cell.j), 0.0, 1.0);
    return cell;
}

// The point at (i, j) from the pole in a quadrant, which is on ring i + j.
uint sphere_point(uint n_side, uint quadrant, uint i, uint j) {
    uint ring = i + j;
    uint cap_place = quadrant * ring + i;
    uint cap_point = 1u + 2u * ring * (ring - 1u) + (cap_place == 4u * ring ? 0u : cap_place);
    uint belt_place = (quadrant * n_side + i - ((ring - n_side) >> 1)) & (4u * n_side - 1u);
    uint belt_point = 1u + 2u * n_side * (n_side - 1u) + 4u * n_side * (ring - n_side) + belt_place;
    return ring == 0u ? 0u : (ring < n_side ? cap_point : belt_point);
}

// The number of a smallest pixel: its western corner is the point after.
uint sphere_pixel(uint n_side, SphereCell cell) {
    return sphere_point(n_side, cell.quadrant, cell.i, cell.j + 1u) - 1u;
}

// The pixel that contains this one and is as large as 4^level of them.
SphereCell sphere_ancestor(SphereCell cell, uint level) {
    uint size = 1u << level;
    uvec2 first = uvec2(cell.i, cell.j) & ~(size - 1u);
    vec2 uv = (vec2(uvec2(cell.i, cell.j) - first) + cell.uv) / float(size);
    return SphereCell(cell.quadrant, first.x, first.y, size, uv);
}

// The pixel that contains a smallest one, on the grid of N_side / 2^steps.
SphereCell sphere_coarser(SphereCell cell, uint steps) {
    SphereCell ancestor = sphere_ancestor(cell, steps);
    return SphereCell(cell.quadrant, ancestor.i >> steps, ancestor.j >> steps, 1u, ancestor.uv);
}

SphereCorners sphere_corners(uint n_side, SphereCell cell) {
    uint east = cell.i + cell.size;
    uint west = cell.j + cell.size;
    float u = cell.uv.x;
    float v = cell.uv.y;
    SphereCorners corners;
    corners.points.x = sphere_point(n_side, cell.quadrant, cell.i, cell.j);
    corners.points.y = sphere_point(n_side, cell.quadrant, east, cell.j);
    corners.points.z = sphere_point(n_side, cell.quadrant, cell.i, west);
    if (east + west <= 2u * n_side) {
        corners.points.w = sphere_point(n_side, cell.quadrant, east, west);
        corners.weights = vec4((1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v);
    } else {
        corners.points.w = corners.points.x;
        corners.weights = vec4(max(1.0 - (u + v), 0.0), u, v, 0.0);
    }
    return corners;
}

// Weights by the inverse of the distance in the pixel's plane, where areas are those on the sphere.
vec4 sphere_inverse_distances(vec2 uv, bool is_triangle) {
    const float nearest = 1e-2;
    vec2 far = 1.0 - uv;
    vec4 distances = vec4(length(uv), length(vec2(far.x, uv.y)), length(vec2(uv.x, far.y)), length(far));
    vec4 weights = 1.0 / max(distances, nearest);
    weights.w = is_triangle ? 0.0 : weights.w;
    return weights / dot(weights, vec4(1.0));
}

#endif
