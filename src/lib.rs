//! `neubrdf`: a Vulkan path tracer for OBJ scenes that proves its radiance against an Embree CPU reference.
//!
//! The rooms, and which way they may look (each knows only those below it):
//!
//! | room | holds |
//! |---|---|
//! | [`capi`] | [`plugin`] for C and C++ |
//! | [`converge`] | error metrics and statistical tests over pictures; studies of speed against error |
//! | [`plugin`] | the path tracer inside a host's Vulkan: records, and nothing else |
//! | [`export`] | the material alone: NeuBRDFs as shader modules and buffers for other tracers |
//! | [`render`] | the wavefront path tracer on Vulkan: queues, film, checkpoints |
//! | `reference` | the Embree CPU path tracer (cargo feature `embree`) |
//! | [`train`] | fits neural BRDFs on the CPU |
//! | [`material`] | what a surface does, on the CPU, in `f64`, as text-book definitions |
//! | [`scene`] | what is rendered: meshes, materials, lights, camera; all validation of input |
//! | [`gpu`] | Vulkan and nothing but Vulkan |
//! | [`image`] | pictures in memory and on disk |

pub mod capi;
pub mod converge;
pub mod export;
pub mod gpu;
pub mod image;
pub mod material;
pub mod plugin;
#[cfg(feature = "embree")]
pub mod reference;
pub mod render;
pub mod scene;
pub mod train;
