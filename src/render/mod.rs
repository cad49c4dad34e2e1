//! The wavefront path tracer on Vulkan.
//!
//! A [`Renderer`] holds a scene on a device and takes samples of all its pixels, pass by pass; [`run`] does so until a limit
//! is reached. The kernels are in `glsl/kernels`; which of them a scene needs stands in [`Features::kernels`].

pub mod bvh;

mod brdf_table;
mod checkpoint;
mod device_lights;
mod device_mesh;
mod device_scene;
mod error;
mod film;
mod gather;
mod geometry;
mod intersector;
mod kernels;
mod layout;
mod material_record;
mod neubrdf_kernels;
mod neubrdf_table;
mod path_tracer;
mod pool;
mod renderer;
mod session;
mod settings;

pub use brdf_table::{BRDF_STRUCTS, pack_nbrdf};
pub use checkpoint::{Checkpoint, Identity};
pub(crate) use device_mesh::Deformed;
pub use device_mesh::{MESH_STRUCTS, MeshRecord};
pub(crate) use device_scene::Changed;
pub use error::Error;
pub use gather::GATHER_STRUCTS;
pub use geometry::{Geometry, INSTANCE_STRUCTS, InstanceRecord};
pub use intersector::{Intersector, Query, RAY_STRUCTS, Ray, RayBatch, RayHit};
pub use kernels::{Features, KernelPlan};
pub use layout::{FeaturePixel, FilmPixel, SceneTable, WAVEFRONT_STRUCTS};
pub use material_record::{Family, MATERIAL_STRUCTS, MaterialRecord, MaterialTable, family};
pub use neubrdf_kernels::NeuBrdfKernels;
pub use neubrdf_table::{
    NEUBRDF_STRUCTS, NeuBrdfHeader, NeuBrdfPush, NeuBrdfQuery, NeuBrdfShape, NeuBrdfValues, SphereTableRecord,
    neubrdf_precision, pack_neubrdf, pack_neubrdf_models,
};
pub(crate) use path_tracer::{ERROR_WORKGROUPS, PathTracer};
pub use renderer::{Options, Renderer};
pub(crate) use session::FEWEST_SAMPLES_FOR_ERROR;
pub use session::{Limits, Progress, Stopped, run};
pub use settings::{BsdfSampling, Sampler, Settings, Traversal, UnknownChoice};
