//! What the surfaces do to light, checked: samplers against densities, energy, reciprocity, and the shaders against
//! the CPU's definitions.

#[path = "../common/mod.rs"]
mod common;
mod configurations;
mod device;
mod energy;
mod layered;
mod networks;
mod sampling;
mod sphere;
mod truths;
