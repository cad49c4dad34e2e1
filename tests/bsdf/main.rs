//! What the surfaces do to light, checked: samplers against densities, energy, reciprocity, and the shaders against
//! the CPU's definitions.

mod configurations;
mod energy;
mod sampling;
mod sphere;
