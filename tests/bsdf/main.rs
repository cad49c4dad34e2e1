//! What the surfaces do to light, checked: samplers against densities, energy, reciprocity, and the shaders against
//! the CPU's definitions.

#[path = "../common/bsdf_structs.rs"]
mod bsdf_structs;
mod configurations;
mod device;
mod energy;
mod sampling;
mod sphere;
