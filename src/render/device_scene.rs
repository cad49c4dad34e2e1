//! The scene in device memory: geometry, materials, textures and lights behind one table of pointers.

use std::mem::replace;
use std::sync::Arc;

use super::device_lights::DeviceLights;
use super::device_mesh::Deformed;
use super::error::Error;
use super::geometry::{Geometry, NextGeometry, Placement};
use super::kernels::Features;
use super::layout::{SceneTable, TextureRecord};
use super::material_record::DeviceMaterials;
use super::neubrdf_kernels::NeuBrdfKernels;
use super::neubrdf_table::neubrdf;
use super::settings::Traversal;
use crate::gpu::{Buffer, HostMesh, Tlas, Update, Upload};
use crate::scene::brdf::Precision;
use crate::scene::{Brdf, Instance, LightTable, Material, Scene, Texture, TexturePlacement};

/// The uploaded scene.
pub struct DeviceScene {
    geometry: Geometry,
    materials: DeviceMaterials,
    lights: DeviceLights,
    /// Where the kernels find the texture records; 0 for none.
    textures: u64,
    table: Arc<Buffer>,
    /// The NeuBRDFs' precision was chosen by whoever asked for it, be it exact or not.
    chosen_precision: bool,
    // Held for the texture records' pointers.
    _buffers: Vec<Arc<Buffer>>,
}

/// What of a scene is another than it was.
#[derive(Clone, Debug, Default)]
pub struct Changed {
    /// Instances were moved, added or removed.
    pub instances: bool,
    /// Meshes have another shape, each named once; their instances count as moved.
    pub deformed: Vec<Deformed>,
    /// How the top level over all instances follows.
    pub top_level: Update,
    /// Materials, by their index, with those whose BRDF is another.
    pub materials: Vec<usize>,
    /// BRDFs, by their index.
    pub brdfs: Vec<usize>,
    /// The sky.
    pub sky: bool,
    /// The sun, or what materials emit.
    pub lights: bool,
}

/// What [`DeviceScene::changed`] made, and then what it took the place of; without what stays as it is.
pub struct NextScene {
    geometry: Option<NextGeometry>,
    materials: Option<DeviceMaterials>,
    lights: Option<DeviceLights>,
}

impl DeviceScene {
    /// Uploads what the features say is there, and nothing else; the numbers of NeuBRDFs in that precision, or in half where it
    /// loses nothing. The meshes of those indices come from a host's buffers.
    pub fn new(
        upload: &mut Upload,
        (scene, host_meshes): (&Scene, &[(u32, HostMesh)]),
        lights: &LightTable,
        features: &Features,
        traversal: Traversal,
        precision: Option<Precision>,
    ) -> Result<DeviceScene, Error> {
        let geometry = Geometry::new(upload, (scene, host_meshes), traversal, features.instanced)?;
        let materials = DeviceMaterials::new(upload, &scene.materials, &scene.brdfs, precision)?;
        let mut buffers = Vec::new();
        let mut textures = 0;
        if features.textures {
            let mut records: Vec<TextureRecord> = Vec::new();
            for (index, texture) in scene.textures.iter().enumerate() {
                let is_there = |before: &Texture| Arc::ptr_eq(&before.texels, &texture.texels);
                let texels = match scene.textures[..index].iter().position(is_there) {
                    Some(before) => records[before].texels,
                    None => {
                        let texels = upload.buffer(&texture.name, &texture.texels)?;
                        buffers.push(texels.clone());
                        texels.address()
                    }
                };
                let TexturePlacement { scale, offset } = texture.placement;
                records.push(TextureRecord {
                    texels,
                    width: texture.width,
                    height: texture.height,
                    scale: scale.into(),
                    offset: offset.into(),
                });
            }
            let records = upload.buffer("textures", &records)?;
            textures = records.address();
            buffers.push(records);
        }
        let lights = DeviceLights {
            lamps: lamps(scene, &geometry),
            ..DeviceLights::default().overwritten(upload, scene, lights, features, true)?
        };
        let table = table(&geometry, geometry.placement(), &materials, textures, &lights);
        let table = upload.buffer("scene table", &[table])?;
        Ok(DeviceScene {
            geometry,
            materials,
            lights,
            textures,
            table,
            chosen_precision: precision.is_some(),
            _buffers: buffers,
        })
    }

    /// Makes what of the scene has changed since, as far as kernels built for these features can render it. `before` are the
    /// materials that the device has. Nothing changes until the upload is recorded and [`DeviceScene::take`] called.
    ///
    /// # Errors
    /// Features that were not built, out of memory.
    pub fn changed(
        &self,
        upload: &mut Upload,
        scene: &Scene,
        before: &[&Material],
        features: &Features,
        changed: &Changed,
    ) -> Result<NextScene, Error> {
        // Lamps stand in the world.
        let lamps = lamps(scene, &self.geometry);
        let bent = changed.deformed.iter().any(|deformed| shines(scene, &self.geometry, deformed.mesh));
        let relit = changed.sky || changed.lights || bent || lamps != self.lights.lamps;
        let light_table = relit.then(|| LightTable::with_tree(scene, features.light_tree));
        let of_lights = light_table.as_ref().map_or(Features::NONE, Features::of_lights);
        let of_the_rest = Features::of_the_rest(scene, |mesh| self.geometry.materials_of(mesh));
        let of_sky = if changed.sky { Features::of_sky(scene) } else { Features::NONE };
        if let Some(what) = features.lacks_of(&of_lights.or(&of_sky).or(&of_the_rest)) {
            return Err(Error::Fixed { what });
        }
        let both = (before, &scene.materials[..]);
        let which = (&changed.materials[..], &changed.brdfs[..]);
        let materials = match changed.materials.is_empty() && changed.brdfs.is_empty() {
            false => {
                let kernels = self.kernels_for(&changed.brdfs, &scene.brdfs)?;
                Some(self.materials.replaced(upload, both, which, &scene.brdfs, kernels)?)
            }
            true => None,
        };
        let moved = changed.instances || !changed.deformed.is_empty();
        let geometry = match moved {
            true => Some(self.geometry.changed(upload, scene, &changed.deformed, changed.top_level)?),
            false => None,
        };
        let lights = match light_table {
            Some(table) => {
                let lights = self.lights.overwritten(upload, scene, &table, features, changed.sky)?;
                Some(DeviceLights { lamps, ..lights })
            }
            None => None,
        };
        let table = table(
            &self.geometry,
            geometry.as_ref().map_or(self.geometry.placement(), NextGeometry::placement),
            materials.as_ref().unwrap_or(&self.materials),
            self.textures,
            lights.as_ref().unwrap_or(&self.lights),
        );
        upload.write(&self.table, &[table])?;
        Ok(NextScene { geometry, materials, lights })
    }

    /// The kernels that evaluate NeuBRDFs, when the BRDFs of those indices are others.
    fn kernels_for(&self, changed: &[usize], brdfs: &[Arc<Brdf>]) -> Result<NeuBrdfKernels, Error> {
        let mut kernels = self.materials.kernels.clone();
        for &index in changed {
            let brdf = &brdfs[index];
            if !kernels.replace(index, brdf) {
                return Err(Error::Fixed { what: "a NeuBRDF that is wider or deeper, or isotropic".to_owned() });
            }
            let is_exact = neubrdf(brdf).is_none_or(|model| kernels.shape(index as u32).is_exact_for(model));
            if !self.chosen_precision && !is_exact {
                return Err(Error::Fixed { what: "a NeuBRDF in single precision".to_owned() });
            }
        }
        Ok(kernels)
    }

    /// Takes what [`DeviceScene::changed`] made. What it returns is to be kept for as long as work may use it.
    pub fn take(&mut self, next: NextScene) -> NextScene {
        NextScene {
            geometry: next.geometry.map(|geometry| self.geometry.take(geometry)),
            materials: next.materials.map(|materials| replace(&mut self.materials, materials)),
            lights: next.lights.map(|lights| replace(&mut self.lights, lights)),
        }
    }

    /// Where the kernels find the scene.
    pub fn table_address(&self) -> u64 {
        self.table.address()
    }

    /// What all kernels are to be specialized with besides: see [`Geometry::specialization`].
    pub fn specialization(&self) -> [(u32, u32); 3] {
        self.geometry.specialization()
    }

    /// The kernels that evaluate NeuBRDFs.
    pub fn neubrdf_kernels(&self) -> &NeuBrdfKernels {
        &self.materials.kernels
    }

    /// The top-level acceleration structure, for ray query.
    pub fn tlas(&self) -> Option<&Tlas> {
        self.geometry.placement().tlas()
    }
}

/// Whether a mesh has a material that emits.
fn shines(scene: &Scene, geometry: &Geometry, mesh: usize) -> bool {
    geometry.materials_of(mesh).iter().any(|material| scene.materials[*material as usize].is_emissive())
}

/// [`DeviceLights::lamps`] of the scene as it is now.
fn lamps(scene: &Scene, geometry: &Geometry) -> Vec<(u32, Instance)> {
    let shine: Vec<bool> = (0..scene.meshes.len()).map(|mesh| shines(scene, geometry, mesh)).collect();
    (0..).zip(scene.instances.iter().copied()).filter(|(_, instance)| shine[instance.mesh as usize]).collect()
}

fn table(
    geometry: &Geometry,
    placement: &Placement,
    materials: &DeviceMaterials,
    textures: u64,
    lights: &DeviceLights,
) -> SceneTable {
    SceneTable {
        instances: placement.instances_address(),
        meshes: geometry.meshes_address(),
        nodes: placement.nodes_address(),
        materials: materials.buffer.address(),
        textures,
        reach: placement.reach(),
        ..lights.table
    }
}
