//! What may change in a scene while it is rendered.

use std::sync::Arc;

use glam::{Affine3A, Vec3};

use crate::gpu::{HostVertices, Update};
use crate::render::{Changed, Deformed};
use crate::scene::{Brdf, Camera, Environment, Flaw, Instance, Material, Scene, Sun, Surface};

/// A change of the scene.
#[derive(Clone, Debug, PartialEq)]
pub enum Change {
    /// Another view. Costs nothing but the copy of a record.
    Camera(Camera),
    /// An instance stands elsewhere. The top level over all instances follows ([`Renderer::set_top_level`](super::Renderer::set_top_level)),
    /// once for all changes of an update: a tree on the CPU for the BVH, an acceleration structure in the next frame for ray query.
    /// Emissive triangles move with it, and the light table is made anew.
    Transform {
        /// Index into [`Scene::instances`].
        instance: u32,
        /// Where it stands: invertible, finite.
        object_to_world: Affine3A,
    },
    /// Other instances of the scene's meshes; at least one. The top level is rebuilt where they are more, fewer, or of other meshes.
    Instances(Vec<Instance>),
    /// A mesh has another shape: the same triangles, texture coordinates and materials over vertices that lie elsewhere. What finds
    /// its triangles is rebuilt or refitted, as said: an acceleration structure in the next frame, or a tree on the CPU. The first
    /// refit is a rebuild, of something that can be refitted. The top level and the light table follow as for [`Change::Transform`].
    Deform {
        /// Index into [`Scene::meshes`].
        mesh: u32,
        /// As many as the mesh has in the scene: the corners of a box, where only the device has its triangles.
        positions: Vec<Vec3>,
        /// Unit normals, as many as the mesh has in the scene.
        normals: Vec<Vec3>,
        /// Where the device reads the vertices, in the next frame; `None` uploads those above. They are as many as at first, with
        /// normals or without as at first.
        from: Option<HostVertices>,
        /// How the structure or tree over its triangles follows.
        by: Update,
    },
    /// A material is another. The light table is made anew if what it emits is.
    ///
    /// A surface that is like no other material's but for its colour is prepared first, which may take a second for coated,
    /// layered, woven and measured ones.
    Material {
        /// Index into [`Scene::materials`].
        index: u32,
        /// What it is now.
        material: Material,
    },
    /// A BRDF, as of a file, in the place of another, or after the last: then a [`Change::Material`] refers to it. Materials that have it are
    /// prepared. Kernels are built for the largest NeuBRDF of [`Scene::brdfs`], with or without a material that has it.
    Brdf {
        /// Index into [`Scene::brdfs`], or how many those are.
        index: u32,
        /// What it is now.
        brdf: Arc<Brdf>,
    },
    /// Another sky, or none. The light table is made anew.
    Environment(Option<Environment>),
    /// Another sun, or none. The light table is made anew.
    Sun(Option<Sun>),
}

/// The parts of a scene that changes touch.
#[derive(Clone)]
pub(super) struct Changeable {
    camera: Camera,
    /// Positions and normals of meshes that were replaced, in order.
    shapes: Vec<(usize, Vec<Vec3>, Vec<Vec3>)>,
    instances: Vec<Instance>,
    pub(super) materials: Vec<Material>,
    brdfs: Vec<Arc<Brdf>>,
    environment: Option<Environment>,
    sun: Option<Sun>,
}

impl Changeable {
    /// What the scene has now.
    pub(super) fn of(scene: &Scene) -> Changeable {
        Changeable {
            camera: scene.camera.clone(),
            shapes: Vec::new(),
            instances: scene.instances.clone(),
            materials: scene.materials.clone(),
            brdfs: scene.brdfs.clone(),
            environment: scene.environment.clone(),
            sun: scene.sun,
        }
    }

    /// Puts it back.
    pub(super) fn restore(self, scene: &mut Scene) {
        scene.camera = self.camera;
        for (mesh, positions, normals) in self.shapes.into_iter().rev() {
            let mesh = &mut scene.meshes[mesh];
            (mesh.positions, mesh.normals) = (positions, normals);
        }
        scene.instances = self.instances;
        scene.materials = self.materials;
        scene.brdfs = self.brdfs;
        scene.environment = self.environment;
        scene.sun = self.sun;
    }
}

/// What an update touches: the camera, and everything else.
#[derive(Default)]
pub(super) struct Touched {
    pub(super) camera: bool,
    pub(super) scene: Changed,
}

impl Touched {
    pub(super) fn is_scene(&self) -> bool {
        let Changed { instances, deformed, materials, brdfs, lights, .. } = &self.scene;
        *instances || *lights || !deformed.is_empty() || !materials.is_empty() || !brdfs.is_empty()
    }
}

/// Makes the changes, in order. `before` is told what it does not have yet.
pub(super) fn apply(scene: &mut Scene, changes: &[Change], before: &mut Changeable) -> Result<Touched, Flaw> {
    let mut touched = Touched::default();
    for change in changes {
        match change {
            Change::Camera(camera) => {
                camera.check()?;
                scene.camera = camera.clone();
                touched.camera = true;
            }
            Change::Transform { instance, object_to_world } => {
                let mut moved = *scene.instance(*instance)?;
                moved.object_to_world = *object_to_world;
                scene.check_instance(*instance, &moved)?;
                scene.instances[*instance as usize] = moved;
                touched.scene.instances = true;
            }
            Change::Instances(instances) => {
                scene.check_instances(instances)?;
                scene.instances.clone_from(instances);
                touched.scene.instances = true;
            }
            Change::Deform { mesh: index, positions, normals, from, by } => {
                scene.check_vertices(*index, positions, normals)?;
                let index = *index as usize;
                let mesh = &mut scene.meshes[index];
                if mesh.triangles.is_empty() && from.is_none() {
                    let part = format!("vertices of mesh {index} ({})", mesh.name);
                    let expected = "in a host's buffers, as its triangles are".into();
                    return Err(Flaw { part, found: "in the change".into(), expected });
                }
                let old_positions = std::mem::replace(&mut mesh.positions, positions.clone());
                let old_normals = std::mem::replace(&mut mesh.normals, normals.clone());
                before.shapes.push((index, old_positions, old_normals));
                touched.scene.deformed.retain(|deformed| deformed.mesh != index);
                touched.scene.deformed.push(Deformed { mesh: index, from: *from, by: *by });
            }
            Change::Material { index, material } => {
                scene.check_material(*index, material)?;
                let now = &mut scene.materials[*index as usize];
                let shines =
                    |material: &Material| (material.emission, material.emission_texture, material.emits_both_sides);
                touched.scene.lights |= shines(now) != shines(material);
                // The top level says which instances have holes.
                touched.scene.instances |= now.opacity.is_whole() != material.opacity.is_whole();
                now.clone_from(material);
                touched.scene.materials.push(*index as usize);
            }
            Change::Brdf { index, brdf } => {
                let (index, count) = (*index as usize, scene.brdfs.len());
                if index > count {
                    let part = "index of a BRDF".into();
                    return Err(Flaw { part, found: index.to_string(), expected: format!("at most {count}") });
                }
                match scene.brdfs.get_mut(index) {
                    Some(now) => now.clone_from(brdf),
                    None => scene.brdfs.push(brdf.clone()),
                }
                // A NeuBRDF's queue hangs on how many come before it.
                let is_measured = |material: &Material| matches!(material.surface, Surface::Measured { .. });
                let measured = (0..scene.materials.len()).filter(|index| is_measured(&scene.materials[*index]));
                touched.scene.materials.extend(measured);
                touched.scene.brdfs.push(index);
            }
            Change::Environment(environment) => {
                if let Some(environment) = environment {
                    environment.check()?;
                }
                scene.environment.clone_from(environment);
                touched.scene.lights = true;
            }
            Change::Sun(sun) => {
                if let Some(sun) = sun {
                    sun.check()?;
                }
                scene.sun = *sun;
                touched.scene.lights = true;
            }
        }
    }
    Ok(touched)
}
