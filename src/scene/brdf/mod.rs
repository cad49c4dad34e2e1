//! BRDFs that a file gives and no closed form does: plain validated data.

mod neubrdf;
mod sphere_grid;

pub use neubrdf::{CornerWeights, Dense, Encoding, Gathered, NO_CODE, NeuBrdf, Provenance, SphereTable};
pub use sphere_grid::{Located, POLE, SphereGrid};
