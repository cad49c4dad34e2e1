//! Fits neural BRDFs to a ground truth, on the CPU, with all cores and their vector units.
mod product;
pub use product::{multiply_add, Left};
