// Paths that neighbouring pixels share: Bekaert, Sbert and Halton, "Accelerating Path Tracing by Re-Using Paths", EGWR 2002.
//
// Pixels of a group each start a path. Where camera rays meet a diffuse surface x (a receiver) and the path goes on to a diffuse
// surface y (a sender), what y sends is of use to all receivers of the group, y being diffuse. x_k takes from y_i
//
//     f_k cos G(x_k, y_i) L_i / Σ_j p_j(y_i) G(x_j, y_i)  =  albedo_k g_ik / Σ_j g_ij L_i,     g_ij = cos(x_j) cos(y_i) V / r²,
//
// the balance heuristic over all paths of the group that could have found y_i: p_j = cos(x_j) / π. Nothing is biased by it. What else
// a path brings (light that falls on x itself, light that x's ray runs into, a y that is not diffuse) stays with its own pixel.
#ifndef LIB_REUSE
#define LIB_REUSE

#include "layout/film.glsl"
#include "lib/pcg.glsl"
#include "lib/surface.glsl"

layout(constant_id = 39) const bool REUSES_PATHS = false;

// Pixels of a square, and of the groups that it is divided into, one of each row: their samples of one index share paths.
const uint REUSE_SQUARE = BAND * BAND;
const uint REUSE_GROUP = BAND;

// Fields of a slot.
const uint RECEIVER_POINT = 0u;       // xyz: x, just off its surface; w: albedo.r
const uint RECEIVER_NORMAL = 1u;      // xyz: shading normal, (0, 0, 0) where there is no receiver; w: albedo.g
const uint RECEIVER_GEOMETRIC = 2u;   // xyz: normal of the triangle, on the viewer's side; w: albedo.b
const uint SENDER_POINT = 3u;         // xyz: y, just off its surface; w: what the path had gathered before it got there, red
const uint SENDER_GEOMETRIC = 4u;     // xyz: normal of the triangle, on x's side, (0, 0, 0) where there is no sender; w: green
const uint SENDER_NORMAL = 5u;        // xyz: shading normal; w: blue
const uint REUSE_TRANSFER = 6u;       // two of them, one slot's after the other: g to each receiver of the group

vec4 reuse_field(uint slot, uint field) {
    return film.reuse.at[field * capacity + slot];
}

void set_reuse_field(uint slot, uint field, vec3 value, float fourth) {
    film.reuse.at[field * capacity + slot] = vec4(value, fourth);
}

// As yet there is neither.
void reuse_begin(uint slot) {
    set_reuse_field(slot, RECEIVER_NORMAL, vec3(0.0), 0.0);
    set_reuse_field(slot, SENDER_GEOMETRIC, vec3(0.0), 0.0);
}

bool reuse_is_receiver(uint slot) {
    return reuse_field(slot, RECEIVER_NORMAL).xyz != vec3(0.0);
}

// Whether there is a sender, and it sends anything. To be asked when all paths have ended.
bool reuse_sends(uint slot) {
    return reuse_field(slot, SENDER_GEOMETRIC).xyz != vec3(0.0) && pool.radiance.at[slot].rgb != vec3(0.0);
}

void reuse_receiver(uint slot, Surface surface, vec3 albedo) {
    set_reuse_field(slot, RECEIVER_POINT, leave(surface, surface.frame.geometric), albedo.r);
    set_reuse_field(slot, RECEIVER_NORMAL, surface.frame.normal, albedo.g);
    set_reuse_field(slot, RECEIVER_GEOMETRIC, surface.frame.geometric, albedo.b);
}

// From here on the path gathers what y sends.
void reuse_sender(uint slot, Surface surface) {
    vec3 before = pool.radiance.at[slot].rgb;
    pool.radiance.at[slot].rgb = vec3(0.0);
    set_reuse_field(slot, SENDER_POINT, leave(surface, surface.frame.geometric), before.r);
    set_reuse_field(slot, SENDER_GEOMETRIC, surface.frame.geometric, before.g);
    set_reuse_field(slot, SENDER_NORMAL, surface.frame.normal, before.b);
}

// The slot of a place for one of the batch's samples, or one beyond all. Members of a group follow one another, and rows are shuffled, so
// that what members err alike looks like noise.
uint reuse_slot(uint place, uint sample_place) {
    uint square = place / REUSE_SQUARE;
    uint group = place / REUSE_GROUP % BAND;
    uint row = place % BAND;
    uint shuffle = pcg3d(uvec3(first_pixel / REUSE_SQUARE + square, 0u, film.seed)).x;
    uint column = group ^ (shuffle >> (3u * row) & 7u);
    uint pixel = square * REUSE_SQUARE + column * BAND + row;
    return pixel < pixel_count ? pixel * samples_per_pixel + sample_place : ~0u;
}

#endif
