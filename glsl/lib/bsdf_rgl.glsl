// Tables over adapted coordinates: src/material/rgl.rs.
#ifndef LIB_BSDF_RGL_GLSL
#define LIB_BSDF_RGL_GLSL

#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_EXT_control_flow_attributes : require
#extension GL_EXT_scalar_block_layout : require

#include "lib/bsdf.glsl"
#include "lib/lobe_table.glsl"

const float RGL_LEAST_SIGMA = 1e-5;
const uint RGL_ISOTROPIC = 1u;
const uint RGL_JACOBIAN = 2u;

// Written by src/render/brdf_table.rs. Sizes are (width, height); where an array starts is counted in words from the table's start.
struct RglRecord {
    uint phis;
    uint thetas;
    uint reduction;
    uint flags;
    uvec2 ndf_size;
    uvec2 sigma_size;
    uvec2 vndf_size;
    uvec2 rgb_size;
    uint phi;
    uint theta;
    uint ndf;
    uint sigma;
    uint density;
    uint conditional;
    uint marginal;
    uint rgb;
};

layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer RglTable {
    RglRecord at[];
};

layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer RglNumbers {
    float at[];
};

struct Brdf {
    uvec2 table;    // an RglTable, and RglNumbers from the same place on
};

Brdf brdf_make(MaterialRecord material) {
    return Brdf(lobe_brdf_data(material));
}

// A cell of a table, and where in it.
struct RglCell {
    uvec2 corner;
    vec2 within;
};

RglCell rgl_cell(uvec2 size, vec2 at) {
    vec2 position = clamp(at, 0.0, 1.0) * vec2(size - 1u);
    uvec2 corner = min(uvec2(position), size - 2u);
    return RglCell(corner, position - vec2(corner));
}

// The table that starts at `start`, in a cell.
float rgl_interpolate(uvec2 numbers, uint start, uvec2 size, RglCell cell) {
    RglNumbers table = RglNumbers(numbers);
    uint upper = start + cell.corner.y * size.x + cell.corner.x;
    uint lower = upper + size.x;
    return mix(mix(table.at[upper], table.at[upper + 1u], cell.within.x),
        mix(table.at[lower], table.at[lower + 1u], cell.within.x), cell.within.y);
}

// The upper one of the two entries about a number of an ascending axis of two or more, and how near it is.
void rgl_bracket(uvec2 numbers, uint start, uint count, float at, out uint upper, out float part) {
    RglNumbers axis = RglNumbers(numbers);
    uint low = 0u;
    upper = count - 1u;
    while (upper - low > 1u) {
        uint middle = (low + upper) / 2u;
        if (axis.at[start + middle] <= at) low = middle;
        else upper = middle;
    }
    float first = axis.at[start + low];
    part = clamp((at - first) / (axis.at[start + upper] - first), 0.0, 1.0);
}

float rgl_across(vec3 w) {
    return sqrt(4.0 * turn_of(length(w.xy), w.z));
}

#define BRDF_EVAL_ONE
vec3 brdf_eval(Brdf b, vec3 wo, vec3 wi) {
    RglRecord table = RglTable(b.table).at[0];
    RglNumbers numbers = RglNumbers(b.table);
    bool is_isotropic = (table.flags & RGL_ISOTROPIC) != 0u;
    uint reduction = table.reduction;
    vec2 towards = vec2(reduction == 4u ? wo.x : wo.y, wo.y);
    vec2 flip = reduction == 1u ? vec2(1.0) : mix(vec2(1.0), vec2(-1.0), greaterThan(towards, vec2(0.0)));
    vec3 viewer = vec3(wo.xy * flip, wo.z);
    vec3 h = normalize(wo + wi);
    h.xy *= flip;
    float viewer_turn = turn_of(viewer.y, viewer.x);
    float normal_turn = turn_of(h.y, h.x) - (is_isotropic ? viewer_turn : 0.0);
    vec2 normal = vec2(rgl_across(h), fract(normal_turn + 0.5));

    // The tables to interpolate between, with their weights.
    uvec4 slices = uvec4(0u);
    vec4 weights = vec4(1.0, 0.0, 0.0, 0.0);
    uint thetas = table.thetas;
    if (thetas > 1u) {
        uint upper;
        float part;
        rgl_bracket(b.table, table.theta, thetas, TWO_PI * turn_of(length(wo.xy), wo.z), upper, part);
        slices = uvec4(upper - 1u, upper, upper - 1u, upper);
        weights = vec4(1.0 - part, part, 0.0, 0.0);
    }
    if (!is_isotropic) {
        uint upper;
        float part;
        rgl_bracket(b.table, table.phi, table.phis, TWO_PI * viewer_turn, upper, part);
        slices += thetas * uvec4(upper - 1u, upper - 1u, upper, upper);
        weights = vec4(weights.xy * (1.0 - part), weights.xy * part);
    }

    // Where sampling of the visible normals picks this one: its row by the marginal, its place in it by the conditional.
    uvec2 size = table.vndf_size;
    RglCell cell = rgl_cell(size, normal);
    vec4 density = vec4(0.0);    // at the corners of the cell
    vec4 along = vec4(0.0);      // of the two rows: the integral up to the cell, and of the whole
    float down = 0.0;
    [[dont_unroll]] for (uint i = 0u; i < 4u; ++i) {
        uint upper = (slices[i] * size.y + cell.corner.y) * size.x;
        uint lower = upper + size.x;
        uint d = table.density + cell.corner.x;
        uint c = table.conditional;
        density += weights[i] * vec4(numbers.at[d + upper], numbers.at[d + upper + 1u], numbers.at[d + lower], numbers.at[d + lower + 1u]);
        along += weights[i] * vec4(numbers.at[c + upper + cell.corner.x], numbers.at[c + lower + cell.corner.x],
            numbers.at[c + upper + size.x - 1u], numbers.at[c + lower + size.x - 1u]);
        down += weights[i] * numbers.at[table.marginal + slices[i] * size.y + cell.corner.y];
    }
    vec2 x = cell.within;
    vec2 sides = mix(density.xy, density.zw, x.y);
    float row = mix(along.z, along.w, x.y);
    float before = mix(along.x, along.y, x.y) + x.x * mix(sides.x, 0.5 * (sides.x + sides.y), x.x);
    float above = down + x.y * mix(along.z, 0.5 * (along.z + along.w), x.y);
    vec2 at = vec2(row > 0.0 ? before / row : 0.0, above);

    RglCell place = rgl_cell(table.rgb_size, at);
    uint texels = table.rgb_size.x * table.rgb_size.y;
    vec3 rgb = vec3(0.0);
    [[dont_unroll]] for (uint i = 0u; i < 4u; ++i) {
        uint start = table.rgb + 3u * slices[i] * texels;
        rgb += weights[i] * vec3(rgl_interpolate(b.table, start, table.rgb_size, place),
            rgl_interpolate(b.table, start + texels, table.rgb_size, place),
            rgl_interpolate(b.table, start + 2u * texels, table.rgb_size, place));
    }
    float facets = 1.0;
    if ((table.flags & RGL_JACOBIAN) != 0u) {
        vec2 seen = vec2(rgl_across(wo), viewer_turn + 0.5);
        float sigma = rgl_interpolate(b.table, table.sigma, table.sigma_size, rgl_cell(table.sigma_size, seen));
        float ndf = rgl_interpolate(b.table, table.ndf, table.ndf_size, rgl_cell(table.ndf_size, normal));
        facets = ndf / (4.0 * max(sigma, RGL_LEAST_SIGMA));
    }
    return max(rgb, 0.0) * (facets / wi.z);
}

#include "lib/lobe.glsl"

#endif
