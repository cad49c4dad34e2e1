//! What may change in a scene while it is rendered.

use glam::Affine3A;

use crate::render::Changed;
use crate::scene::{Camera, Environment, Flaw, Instance, Material, Scene, Sun};

/// A change of the scene.
#[derive(Clone, Debug, PartialEq)]
pub enum Change {
    /// Another view. Costs nothing but the copy of a record.
    Camera(Camera),
    /// An instance stands elsewhere. The top level over all instances is rebuilt, once for all changes of an update: a tree on
    /// the CPU for the BVH, an acceleration structure in the next frame for ray query. Emissive triangles move with it, and the
    /// light table is made anew.
    Transform {
        /// Index into [`Scene::instances`].
        instance: u32,
        /// Where it stands: invertible, finite.
        object_to_world: Affine3A,
    },
    /// Other instances of the scene's meshes; at least one. The top level is rebuilt.
    Instances(Vec<Instance>),
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
    /// Another sky, or none. The light table is made anew.
    Environment(Option<Environment>),
    /// Another sun, or none. The light table is made anew.
    Sun(Option<Sun>),
}

/// The parts of a scene that changes touch.
#[derive(Clone)]
pub(super) struct Changeable {
    camera: Camera,
    instances: Vec<Instance>,
    pub(super) materials: Vec<Material>,
    environment: Option<Environment>,
    sun: Option<Sun>,
}

impl Changeable {
    /// What the scene has now.
    pub(super) fn of(scene: &Scene) -> Changeable {
        Changeable {
            camera: scene.camera.clone(),
            instances: scene.instances.clone(),
            materials: scene.materials.clone(),
            environment: scene.environment.clone(),
            sun: scene.sun,
        }
    }

    /// Puts it back.
    pub(super) fn restore(self, scene: &mut Scene) {
        scene.camera = self.camera;
        scene.instances = self.instances;
        scene.materials = self.materials;
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
        self.scene.instances || self.scene.lights || !self.scene.materials.is_empty()
    }
}

/// Makes the changes, in order.
pub(super) fn apply(scene: &mut Scene, changes: &[Change]) -> Result<Touched, Flaw> {
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
            Change::Material { index, material } => {
                scene.check_material(*index, material)?;
                let now = &mut scene.materials[*index as usize];
                let shines = |material: &Material| (material.emission, material.emits_both_sides);
                touched.scene.lights |= shines(now) != shines(material);
                now.clone_from(material);
                touched.scene.materials.push(*index as usize);
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
