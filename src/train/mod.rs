//! Fits neural BRDFs to a ground truth, on the CPU, with all cores and their vector units.

pub mod adam;
pub mod ball;
pub mod measure;
pub mod network;
pub mod pairs;
pub mod product;
pub mod random;
pub mod table;
pub mod trainer;
pub mod vector;
