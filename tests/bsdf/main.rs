//! What the surfaces do to light, checked: samplers against densities, energy, reciprocity, and the shaders against
//! the CPU's definitions.

#[path = "../common/mod.rs"]
mod common;
mod configurations;
mod device;
mod energy;
mod exported;
mod layered;
mod networks;
#[path = "../common/on_wgpu.rs"]
mod on_wgpu;
mod sampling;
mod sphere;
mod truths;
