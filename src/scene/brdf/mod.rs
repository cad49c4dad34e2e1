//! BRDFs that a file gives and no closed form does: plain validated data.

mod neubrdf;
mod neubrdf_check;
mod neubrdf_file;
mod sphere_grid;

pub use neubrdf::{CornerWeights, Dense, Encoding, Gathered, NO_CODE, NeuBrdf, Provenance, SphereTable};
pub use neubrdf_check::Flaw;
pub use neubrdf_file::Precision;
pub use sphere_grid::{Located, POLE, SphereGrid};
