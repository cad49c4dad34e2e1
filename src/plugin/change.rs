//! What may change in a scene while it is rendered.

use std::mem::swap;
use std::sync::Arc;

use glam::{Affine3A, Vec3};

use crate::gpu::{HostVertices, Update};
use crate::render::{Changed, Deformed};
use crate::scene::{Brdf, Camera, Environment, Flaw, Instance, Material, Scene, Sun, Surface, check_brdf};

/// A change of the scene.
#[derive(Clone, Debug, PartialEq)]
pub enum Change {
    /// Another view. Costs nothing but the copy of a record, whatever the scene.
    Camera(Camera),
    /// An instance stands elsewhere. The top level over all instances follows ([`Renderer::set_top_level`](super::Renderer::set_top_level)),
    /// once for all changes of an update: a tree on the CPU for the BVH, an acceleration structure in the next frame for ray query.
    /// Emissive triangles move with it: then the light table is made anew.
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
    /// refit is a rebuild, of something that can be refitted. The top level follows as for [`Change::Transform`], and so does the light
    /// table.
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
    /// prepared. What fits the widest and deepest NeuBRDFs of [`Scene::brdfs`], with or without a material that has them, has a kernel.
    Brdf {
        /// Index into [`Scene::brdfs`], or how many those are.
        index: u32,
        /// What it is now.
        brdf: Arc<Brdf>,
    },
    /// Another sky, or none. The light table is made anew, and the texels are uploaded.
    Environment(Option<Environment>),
    /// Another sun, or none. The light table is made anew.
    Sun(Option<Sun>),
}

/// What an update has replaced so far: of the scene that was there, what the changes touch and no more.
pub(super) struct Before {
    /// For each change, the one that takes it back.
    replaced: Vec<Change>,
    /// How many BRDFs there were.
    brdfs: usize,
}

impl Before {
    /// Nothing yet.
    pub(super) fn of(scene: &Scene) -> Before {
        Before { replaced: Vec::new(), brdfs: scene.brdfs.len() }
    }

    /// Puts it back.
    pub(super) fn restore(mut self, scene: &mut Scene) {
        self.replaced.iter_mut().rev().for_each(|change| exchange(scene, change));
        scene.brdfs.truncate(self.brdfs);
    }

    /// The materials that there were.
    pub(super) fn materials<'a>(&'a self, scene: &'a Scene) -> Vec<&'a Material> {
        let mut materials: Vec<&Material> = scene.materials.iter().collect();
        for change in self.replaced.iter().rev() {
            if let Change::Material { index, material } = change {
                materials[*index as usize] = material;
            }
        }
        materials
    }
}

/// Makes a change that has been checked. What it replaced is in its place then: a change that takes this one back.
fn exchange(scene: &mut Scene, change: &mut Change) {
    match change {
        Change::Camera(camera) => swap(&mut scene.camera, camera),
        Change::Transform { instance, object_to_world } => {
            swap(&mut scene.instances[*instance as usize].object_to_world, object_to_world);
        }
        Change::Instances(instances) => swap(&mut scene.instances, instances),
        Change::Deform { mesh, positions, normals, .. } => {
            let mesh = &mut scene.meshes[*mesh as usize];
            swap(&mut mesh.positions, positions);
            swap(&mut mesh.normals, normals);
        }
        Change::Material { index, material } => swap(&mut scene.materials[*index as usize], material),
        Change::Brdf { index, brdf } => match scene.brdfs.get_mut(*index as usize) {
            Some(now) => swap(now, brdf),
            // It took no other's place: [`Before::restore`] goes by their number.
            None => scene.brdfs.push(brdf.clone()),
        },
        Change::Environment(environment) => swap(&mut scene.environment, environment),
        Change::Sun(sun) => swap(&mut scene.sun, sun),
    }
}

/// What an update touches: the camera, and everything else.
#[derive(Default)]
pub(super) struct Touched {
    pub(super) camera: bool,
    pub(super) scene: Changed,
}

/// Makes the changes, in order. `before` is told what they replace.
pub(super) fn apply(scene: &mut Scene, changes: &[Change], before: &mut Before) -> Result<Touched, Flaw> {
    let mut touched = Touched::default();
    for change in changes {
        touched.add(scene, change)?;
        let mut change = change.clone();
        exchange(scene, &mut change);
        before.replaced.push(change);
    }
    Ok(touched)
}

/// Makes the changes of a scene that is not rendered, all of them or, on an error, none.
pub(crate) fn change(scene: &mut Scene, changes: &[Change]) -> Result<(), Flaw> {
    let mut before = Before::of(scene);
    let made = apply(scene, changes, &mut before);
    made.map(|_| ()).inspect_err(|_| before.restore(scene))
}

impl Touched {
    pub(super) fn is_scene(&self) -> bool {
        let Changed { instances, deformed, materials, brdfs, sky, lights, .. } = &self.scene;
        *instances || *sky || *lights || !deformed.is_empty() || !materials.is_empty() || !brdfs.is_empty()
    }

    /// Checks a change of the scene, and adds what it touches.
    fn add(&mut self, scene: &Scene, change: &Change) -> Result<(), Flaw> {
        match change {
            Change::Camera(camera) => {
                camera.check()?;
                self.camera = true;
            }
            Change::Transform { instance, object_to_world } => {
                let moved = Instance { object_to_world: *object_to_world, ..*scene.instance(*instance)? };
                scene.check_instance(*instance, &moved)?;
                self.scene.instances = true;
            }
            Change::Instances(instances) => {
                scene.check_instances(instances)?;
                self.scene.instances = true;
            }
            Change::Deform { mesh: index, positions, normals, from, by } => {
                scene.check_vertices(*index, positions, normals)?;
                let index = *index as usize;
                let mesh = &scene.meshes[index];
                if mesh.triangles.is_empty() && from.is_none() {
                    let part = format!("vertices of mesh {index} ({})", mesh.name);
                    let expected = "in a host's buffers, as its triangles are".into();
                    return Err(Flaw { part, found: "in the change".into(), expected });
                }
                self.scene.deformed.retain(|deformed| deformed.mesh != index);
                self.scene.deformed.push(Deformed { mesh: index, from: *from, by: *by });
            }
            Change::Material { index, material } => {
                scene.check_material(*index, material)?;
                let now = &scene.materials[*index as usize];
                let shines =
                    |material: &Material| (material.emission, material.emission_texture, material.emits_both_sides);
                self.scene.lights |= shines(now) != shines(material);
                // The top level says which instances have holes.
                self.scene.instances |= now.opacity.is_whole() != material.opacity.is_whole();
                self.scene.materials.push(*index as usize);
            }
            Change::Brdf { index, brdf } => {
                check_brdf(brdf)?;
                let (index, count) = (*index as usize, scene.brdfs.len());
                if index > count {
                    let part = "index of a BRDF".into();
                    return Err(Flaw { part, found: index.to_string(), expected: format!("at most {count}") });
                }
                // A NeuBRDF's queue hangs on how many come before it.
                let is_measured = |material: &Material| matches!(material.surface, Surface::Measured { .. });
                let measured = (0..scene.materials.len()).filter(|index| is_measured(&scene.materials[*index]));
                self.scene.materials.extend(measured);
                self.scene.brdfs.push(index);
            }
            Change::Environment(environment) => {
                environment.as_ref().map_or(Ok(()), Environment::check)?;
                self.scene.sky = true;
            }
            Change::Sun(sun) => {
                sun.as_ref().map_or(Ok(()), Sun::check)?;
                self.scene.lights = true;
            }
        }
        Ok(())
    }
}
