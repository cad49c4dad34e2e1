// A NeuBRDF in memory, as src/render/neubrdf_table.rs packs it: a header, and behind it arrays that are found by their distance from
// it in groups of four words, all at multiples of 16 bytes.
#ifndef LAYOUT_NEUBRDF
#define LAYOUT_NEUBRDF

// What all models that a kernel evaluates are filled up to, with zeros.
layout(constant_id = 20) const uint NEUBRDF_FEATURE_GROUPS = 4u;   // of four features, of a direction on one grid
layout(constant_id = 21) const uint NEUBRDF_HIDDEN_GROUPS = 16u;   // of four neurons, of a layer that is not the last
layout(constant_id = 22) const uint NEUBRDF_LAYERS = 4u;
layout(constant_id = 23) const bool NEUBRDF_HALF = false;          // codes, weights and biases are f16
layout(constant_id = 24) const bool NEUBRDF_ISOTROPIC = true;      // some model is
layout(constant_id = 31) const uint NEUBRDF_RESOLUTIONS = 1u;      // grids of a hemisphere
layout(constant_id = 28) const uint NEUBRDF_SURFACE_GROUPS = 0u;   // of four features of a place; 0 where no model varies
layout(constant_id = 38) const bool NEUBRDF_SEES_HALF_VECTOR = false;   // some model does
layout(constant_id = 30) const bool NEUBRDF_FRAMES = false;        // places of some model have frames

struct SphereTableRecord {
    uint n_side;
    uint codes;     // of four numbers each: the codes, one after another
    uint indices;   // of grid points, two a word
    uint levels;    // of pixels, four a word: how often they were merged; 0 where none was
};

// Words of a header.
const uint NEUBRDF_HEADER_WORDS = 16u;

struct NeuBrdfHeader {
    SphereTableRecord wi;
    SphereTableRecord wo;
    uint layers;           // see lib/neubrdf.glsl
    uint is_isotropic;
    uint has_equal_weights;
    float scale;           // of the network's output: the exponent
    float most_exponent;   // at which the value is the greatest
    float inverse_gain;
    uint surface;          // see lib/neubrdf_surface.glsl; 0: the model is the same everywhere
    uint coarser;          // resolutions besides the finest: for each the records of ωi and ωo, one after another behind the header
};

#endif
