//! converge

pub mod chi_square;
