//! Vulkan and nothing but Vulkan: device, memory, kernels, acceleration structures.
//!
//! A program opens an [`Instance`], from it a [`Device`], makes [`Buffer`]s and [`Kernel`]s, records [`Commands`],
//! submits them and waits for the [`Submission`]:
//!
//! ```no_run
//! use neubrdf::gpu::{Buffer, Commands, DeviceChoice, Instance, Kernel, Memory, Validation, spirv};
//! # fn main() -> neubrdf::gpu::Result<()> {
//! let device = Instance::new(Validation::Off)?.open(&DeviceChoice::Auto)?;
//! let kernel = Kernel::new(&device, spirv::load("gpu_test_fill").unwrap(), &[])?;
//! let numbers = Buffer::new(&device, "numbers", 4 * 1000, Memory::Device)?;
//! let mut commands = Commands::begin(&device)?;
//! commands.timestamp("fill");
//! commands.dispatch(&kernel, kernel.groups_for(1000), &[numbers.address(), 1000]);
//! for (pass, nanoseconds) in device.submit(commands)?.wait()? {
//!     println!("{pass}: {nanoseconds:?} ns");
//! }
//! let numbers: Vec<u32> = numbers.read()?;
//! # Ok(())
//! # }
//! ```
//!
//! Kernels find their data through buffer device addresses in push constants, so there are no descriptors, but for the
//! one acceleration structure of a ray-query kernel (set 0, binding 0).
//!
//! **Order.** Submissions of one device run one after the other, in the order of [`Device::submit`]; each sees what those
//! before it wrote. Within one, passes that depend on each other need [`Commands::barrier`] between them.
//!
//! **Lifetime.** A buffer, kernel or acceleration structure may be dropped at any time: its memory is given back once the
//! work that was recorded or submitted by then is done. Only of commands that a host submits ([`Commands::wrap`]) this
//! room knows nothing after [`Commands::finish`]: what they use must be kept until they are done.

#![allow(unsafe_code)]

pub mod layout;
pub mod spirv;

mod acceleration;
mod buffer;
mod commands;
mod device;
mod error;
mod host_mesh;
mod host_target;
mod instance;
mod kernel;
mod memory;
mod profile;
mod requirements;
mod upload;

pub use acceleration::{Blas, BlasGeometry, Tlas, TlasInstance, TlasRecord, Update};
pub use buffer::{Buffer, Memory};
pub use commands::{Commands, Submission};
pub use device::{Device, HostDevice};
pub use error::{Error, Result};
pub use host_mesh::{HostArray, HostIndices, HostMesh, HostVertices, IndexFormat};
pub use host_target::{HostBuffer, HostImage};
pub use instance::{DeviceChoice, Instance, Validation};
pub use kernel::{Kernel, KernelSource};
pub use memory::{HostAllocator, HostMemory, MemoryRequest};
pub use profile::{DeviceReport, Limits, PUSH_CONSTANT_BYTES, Profile};
pub use requirements::{Additions, Requirements, requirements};
pub use upload::Upload;
// What a host must speak with us: the same versions.
pub use {ash, gpu_allocator};
