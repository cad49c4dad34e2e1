//! A scene in device memory: geometry, materials, textures and lights behind one table of pointers.

use std::sync::Arc;

use glam::{Affine3A, Vec3};

use super::error::Error;
use super::geometry::Geometry;
use super::kernels::Features;
use super::layout::{AliasRecord, EmitterRecord, SceneTable, TextureRecord};
use super::material_record::MaterialTable;
use super::neubrdf_table::{NeuBrdfShape, neubrdf_precision};
use super::settings::Traversal;
use crate::gpu::{Buffer, Device, Tlas};
use crate::scene::brdf::Precision;
use crate::scene::{Environment, LightTable, Scene};

/// The uploaded scene.
pub struct DeviceScene {
    geometry: Geometry,
    table: Buffer,
    neubrdf_shape: NeuBrdfShape,
    // Held for the table's pointers.
    _buffers: Vec<Buffer>,
}

impl DeviceScene {
    /// Uploads what the features say is there, and nothing else; the numbers of NeuBRDFs in that precision, or in half where it
    /// loses nothing.
    pub fn upload(
        device: &Arc<Device>,
        scene: &Scene,
        lights: &LightTable,
        features: &Features,
        traversal: Traversal,
        precision: Option<Precision>,
    ) -> Result<DeviceScene, Error> {
        let geometry = Geometry::upload(device, scene, traversal)?;
        let mut buffers = Vec::new();
        let mut keep = |buffer: Buffer| {
            let address = buffer.address();
            buffers.push(buffer);
            address
        };

        let materials = MaterialTable::new(
            &scene.materials,
            &scene.brdfs,
            precision.unwrap_or_else(|| neubrdf_precision(&scene.brdfs)),
        );
        let neubrdf_shape = materials.neubrdf_shape.on(device);
        let tables = materials.tables.iter().map(|table| Ok(keep(Buffer::with_data(device, "material table", table)?)));
        let tables = tables.collect::<Result<Vec<_>, Error>>()?;
        let materials = keep(Buffer::with_data(device, "materials", &materials.records(&tables))?);
        let mut textures = 0;
        if features.textures {
            let mut records = Vec::new();
            for texture in &scene.textures {
                let texels = keep(Buffer::with_data(device, &texture.name, &texture.texels)?);
                records.push(TextureRecord { texels, width: texture.width, height: texture.height });
            }
            textures = keep(Buffer::with_data(device, "textures", &records)?);
        }
        let mut light_alias = 0;
        if features.has_lights() {
            let alias: Vec<_> =
                lights.alias.iter().map(|(keep, alias)| AliasRecord { keep: *keep, alias: *alias }).collect();
            light_alias = keep(Buffer::with_data(device, "light table", &alias)?);
        }
        let mut emitters = 0;
        if features.emitters {
            let records: Vec<_> = lights.triangles.iter().map(|triangle| emitter(scene, *triangle)).collect();
            emitters = keep(Buffer::with_data(device, "emitters", &records)?);
        }
        let mut environment = 0;
        if let Some(sky) = scene.environment.as_ref().filter(|_| features.environment) {
            environment = keep(Buffer::with_data(device, "environment", &sky.texels)?);
        }

        let sky = scene.environment.as_ref();
        let turn = sky.map_or(0.0, |sky| sky.rotation_degrees).to_radians();
        let sun = scene.sun;
        let table = SceneTable {
            instances: geometry.instances_address(),
            meshes: geometry.meshes_address(),
            nodes: geometry.nodes_address(),
            materials,
            textures,
            light_alias,
            emitters,
            environment,
            light_count: lights.len() as u32,
            emitter_count: lights.triangles.len() as u32,
            environment_size: sky.map_or([0, 0], |sky: &Environment| [sky.width, sky.height]),
            environment_rotation: [turn.cos(), turn.sin()],
            emitter_density: lights.emitter_density as f32,
            environment_density: lights.environment_density as f32,
            sun_probability: lights.sun_probability as f32,
            sun_direction: sun.map_or(Vec3::ZERO, |sun| sun.direction).to_array(),
            sun_irradiance: sun.map_or(Vec3::ZERO, |sun| sun.irradiance).to_array(),
            reach: 2.5 * scene.bounds().radius() + 1e-30,
        };
        let table = Buffer::with_data(device, "scene table", &[table])?;
        Ok(DeviceScene { geometry, table, neubrdf_shape, _buffers: buffers })
    }

    /// Where the kernels find the scene.
    pub fn table_address(&self) -> u64 {
        self.table.address()
    }

    /// What kernels are to be specialized with: see [`Geometry::specialization`], [`NeuBrdfShape::specialization`].
    pub fn specialization(&self) -> Vec<(u32, u32)> {
        [&self.geometry.specialization()[..], &self.neubrdf_shape.specialization()].concat()
    }

    /// The top-level acceleration structure, for ray query.
    pub fn tlas(&self) -> Option<&Tlas> {
        self.geometry.tlas()
    }
}

/// An emissive triangle in world space, its corners ordered so that edge_u × edge_v points to its front.
fn emitter(scene: &Scene, [instance, triangle]: [u32; 2]) -> EmitterRecord {
    let instance = &scene.instances[instance as usize];
    let mesh = &scene.meshes[instance.mesh as usize];
    let to_world: Affine3A = instance.object_to_world;
    let [a, b, c] = mesh.corners(triangle as usize).map(|corner| to_world.transform_point3(corner));
    let (b, c) = if to_world.matrix3.determinant() < 0.0 { (c, b) } else { (b, c) };
    let material = &scene.materials[mesh.material(triangle as usize) as usize];
    EmitterRecord {
        corner: a.to_array(),
        edge_u: (b - a).to_array(),
        edge_v: (c - a).to_array(),
        emission: material.emission.to_array(),
        emits_both_sides: u32::from(material.emits_both_sides),
    }
}
