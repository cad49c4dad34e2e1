//! What is rendered: meshes and their instances, materials, lights, camera, film.
//!
//! A [`Scene`] is plain data in linear Rec. 709 RGB and world units, fully validated when it is loaded: every
//! index in it is in range, every float finite, every image non-empty. Nothing here knows how it is rendered.
//!
//! Conventions: right-handed, y up, counter-clockwise triangles face their normal. Radiance is in
//! W·sr⁻¹·m⁻² per channel.

pub mod brdf;
mod btf;
mod camera;
mod check;
mod decode;
pub(crate) mod error;
mod file;
mod hash;
mod layered;
mod light;
mod light_tree;
mod material;
mod mesh;
mod metals;
mod mtl;
mod named_file;
mod normals;
mod obj;
mod polygon;
mod recentre;
mod statements;
mod surface_file;
mod surface_maps;
pub(crate) mod table;
mod texture;
mod woven;

pub use brdf::{
    Brdf, HalfDifference, Merl, Nbrdf, Rgl, RglTable, RglTables, RglWarp, SamplingLobe, Sparse, SparseSample,
};
pub use btf::{Btf, BtfPreview};
pub use camera::{Camera, Film, Lens};
pub use check::Flaw;
pub(crate) use check::check_brdf;
pub use error::{Error, Place, Warning};
pub use layered::{LayerBase, Layered};
pub use light::{EmissiveTriangle, Environment, LightTable, Sun, luminance};
pub use light_tree::{LightNode, LightTree, Receiver};
pub use material::{Color, Fresnel, Material, Opacity, Patches, Surface};
pub use mesh::{Bounds, Instance, Mesh};
pub use named_file::named_files;
pub use surface_maps::SurfaceMaps;
pub use texture::{Texture, TexturePlacement};
pub use woven::{Woven, Yarn};
// What whoever puts a scene together must speak with us: the same versions.
pub use {glam, half};

use std::sync::Arc;

/// Everything that a renderer needs to know about a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// Where the picture is taken from.
    pub camera: Camera,
    /// Its size in pixels.
    pub film: Film,
    /// Geometry, each once.
    pub meshes: Vec<Mesh>,
    /// Where the meshes stand; at least one.
    pub instances: Vec<Instance>,
    /// What [`Mesh::materials`] indexes; at least one.
    pub materials: Vec<Material>,
    /// What [`Color::texture`] indexes.
    pub textures: Vec<Texture>,
    /// What [`Surface::Measured`] indexes.
    pub brdfs: Vec<Arc<Brdf>>,
    /// Light from infinitely far away, all around.
    pub environment: Option<Environment>,
    /// Light from infinitely far away, from one direction.
    pub sun: Option<Sun>,
}
