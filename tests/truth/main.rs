//! Ground truths that no closed form gives: tables and samples from files, against what they were made of, and surfaces that are
//! simulated.

#[path = "../common/mod.rs"]
mod common;
mod hostile;
mod merl;
#[cfg(feature = "embree")]
mod proof;
mod random;
mod rgl;
mod scene;
mod sparse;
mod woven;
