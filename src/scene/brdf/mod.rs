//! BRDFs that come from files: plain data, validated when it is loaded.

mod merl;
mod rgl;
mod sparse;
mod tensor_file;

pub use merl::Merl;
pub use rgl::{Rgl, RglTable};
pub use sparse::{Sparse, SparseSample};
