//! Which kernels a scene needs, and how they are specialized. What a scene lacks is not in the list: it is never built.

use std::sync::Arc;

use glam::{Affine3A, Vec3};
use half::f16;

use super::error::Error;
use super::material_record::{Family, family};
use super::neubrdf_kernels::neubrdf_queues;
use super::neubrdf_table::NeuBrdfShape;
use super::settings::{Settings, Traversal};
use crate::gpu::{self, Device, Kernel};
use crate::scene::{Brdf, LightTable, Material, Scene, Surface};

/// A kernel of the wavefront by the name of its source, with its specialization constants (id, value).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct KernelPlan {
    /// The file's name in `glsl/kernels`, without its ending.
    pub name: &'static str,
    /// `constant_id` and value.
    pub specialization: Vec<(u32, u32)>,
}

/// Declares [`Features`]: of what is there or not, each with the specialization constant that kernels know it by, and the words for it.
macro_rules! features {
    ($($(#[$doc:meta])* $name:ident: $constant:literal, $words:literal;)*) => {
        /// What a scene has, as far as kernels differ by it.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub struct Features {
            /// Bit f: a material of family f is on a mesh.
            pub families: u32,
            /// Queues of [`Family::NeuBrdf`], one a model: from 1 to [`Features::MOST_NEUBRDF_QUEUES`].
            pub neubrdf_queues: u32,
            $($(#[$doc])* pub $name: bool,)*
        }

        impl Features {
            /// No feature at all.
            pub const NONE: Features = Features { families: 0, neubrdf_queues: 1, $($name: false,)* };

            /// What one of both has.
            pub fn or(&self, other: &Features) -> Features {
                Features {
                    families: self.families | other.families,
                    neubrdf_queues: self.neubrdf_queues.max(other.neubrdf_queues),
                    $($name: self.$name || other.$name,)*
                }
            }

            /// What is there or not: constant, whether it is, words.
            fn flags(&self) -> impl Iterator<Item = (u32, bool, &'static str)> {
                [$(($constant, self.$name, $words),)*].into_iter()
            }
        }
    };
}

features! {
    /// Some triangle emits.
    emitters: 2, "emissive triangles";
    /// A tree picks one of the emissive triangles, of which there are more than a few.
    light_tree: 36, "a tree over emissive triangles";
    /// There is a sky.
    environment: 3, "a sky";
    /// The sky is worth light samples: some of it is much brighter than the rest.
    uneven_sky: 33, "a sky that is brighter here than there";
    /// There is a sun.
    sun: 4, "a sun";
    /// Some material on a mesh has a texture.
    textures: 6, "textures";
    /// Some material on a mesh lets rays through.
    holes: 15, "materials with holes";
    /// Some material on a mesh has a map of normals.
    normal_maps: 16, "maps of normals";
    /// Some material on a mesh has a map of its roughness.
    roughness_maps: 17, "maps of roughness";
    /// Some material on a mesh has a map of the direction of its anisotropy.
    anisotropy_direction_maps: 37, "maps of anisotropy";
    /// Some triangle emits by a texture.
    emission_maps: 18, "textures that emit";
    /// Some material on a mesh has patches of another one.
    patches: 19, "materials with patches of another";
    /// Some material on a mesh varies over a texture otherwise than by a colour.
    footprints: 29, "NeuBRDFs that vary over a texture";
    /// The camera has a lens.
    lens: 8, "a lens";
    /// More than one instance, or one that is moved.
    instanced: 7, "instances that move";
}

impl Features {
    /// Looks at a scene and its lights. Lights without power count as none.
    pub fn of(scene: &Scene, lights: &LightTable) -> Features {
        let materials_of = |mesh: usize| &scene.meshes[mesh].materials[..];
        Features::of_lights(lights).or(&Features::of_sky(scene)).or(&Features::of_the_rest(scene, materials_of))
    }

    /// What a table of lights has.
    pub(super) fn of_lights(lights: &LightTable) -> Features {
        Features {
            emitters: !lights.is_empty() && !lights.triangles.is_empty(),
            light_tree: lights.tree.is_some(),
            uneven_sky: lights.environment_texels > 0,
            ..Features::NONE
        }
    }

    /// What its sky asks for: a look at its texels, down to the first that is not black.
    pub(super) fn of_sky(scene: &Scene) -> Features {
        let environment = scene.environment.as_ref().is_some_and(|sky| !sky.is_black());
        Features { environment, ..Features::NONE }
    }

    /// What a scene has besides; `materials_of` are those of a mesh, each once or more often.
    pub(super) fn of_the_rest<'a>(scene: &Scene, materials_of: impl Fn(usize) -> &'a [u32]) -> Features {
        let mut placed = vec![false; scene.meshes.len()];
        scene.instances.iter().for_each(|instance| placed[instance.mesh as usize] = true);
        let mut used = vec![false; scene.materials.len()];
        for material in (0..placed.len()).filter(|mesh| placed[*mesh]).flat_map(materials_of) {
            used[*material as usize] = true;
            if let Some(patches) = scene.materials[*material as usize].patches {
                used[patches.material as usize] = true;
            }
        }
        let used = || scene.materials.iter().zip(&used).filter(|(_, used)| **used).map(|(material, _)| material);
        Features {
            families: used().fold(0, |mask, material| mask | 1 << family(&material.surface, &scene.brdfs) as u32),
            neubrdf_queues: neubrdf_queues(&scene.brdfs),
            emitters: used().any(|material| glows(material, scene)),
            sun: scene.sun.is_some_and(|sun| sun.irradiance != Vec3::ZERO),
            textures: used().any(|material| material.textures().next().is_some()),
            holes: used().any(|material| !material.opacity.is_whole()),
            normal_maps: used().any(|material| material.normal_map.is_some()),
            roughness_maps: used().any(|material| material.roughness_map.is_some()),
            anisotropy_direction_maps: used().any(|material| material.anisotropy_direction_map.is_some()),
            patches: used().any(|material| material.patches.is_some()),
            emission_maps: used().any(|material| material.is_emissive() && material.emission_texture.is_some()),
            footprints: used().any(|material| is_spatial(&material.surface, &scene.brdfs)),
            lens: scene.camera.lens.is_some(),
            instanced: is_instanced(scene),
            environment: false,
            light_tree: false,
            uneven_sky: false,
        }
    }

    /// Whether the numbers are in their ranges.
    pub(crate) fn check(&self) -> Result<(), Error> {
        let wrong = |name, found: u32, expected| Err(Error::Setting { name, found: found.to_string(), expected });
        if self.families >> Family::ALL.len() != 0 {
            return wrong("Features::families", self.families, "a bit for each of Family::ALL");
        }
        if !(1..=Features::MOST_NEUBRDF_QUEUES).contains(&self.neubrdf_queues) {
            return wrong("Features::neubrdf_queues", self.neubrdf_queues, "from 1 to MOST_NEUBRDF_QUEUES");
        }
        Ok(())
    }

    /// More models than this share queues.
    pub const MOST_NEUBRDF_QUEUES: u32 = 16;

    /// Something that `other` has and this lacks.
    pub fn lacks_of(&self, other: &Features) -> Option<String> {
        let missing = Family::ALL.into_iter().find(|family| other.has(*family) && !self.has(*family));
        if let Some(family) = missing {
            return Some(format!("materials of the family {}", family.name()));
        }
        if self.neubrdf_queues < other.neubrdf_queues {
            return Some("so many NeuBRDFs".to_owned());
        }
        let missing = self.flags().zip(other.flags()).find(|((_, has, _), (_, needs, _))| *needs && !has);
        missing.map(|((_, _, words), _)| words.to_owned())
    }

    /// Whether some material of the family is in the scene.
    pub fn has(&self, family: Family) -> bool {
        self.families & 1 << family as u32 != 0
    }

    /// The place of a family among those that the scene has.
    pub fn place(&self, family: Family) -> u32 {
        (self.families & ((1 << family as u32) - 1)).count_ones()
    }

    /// How many queues of the family there are, if it is in the scene.
    pub fn queues(&self, family: Family) -> u32 {
        if family == Family::NeuBrdf { self.neubrdf_queues } else { 1 }
    }

    /// Whether there is light to sample. An even sky alone is left to the paths.
    pub fn samples_lights(&self) -> bool {
        self.emitters || self.uneven_sky || self.sun
    }

    /// The kernels that render a scene with these features, in the order in which a bounce runs them.
    pub fn kernels(&self, traversal: Traversal, settings: &Settings, workgroup_size: u32) -> Vec<KernelPlan> {
        let flag = |id: u32, value: bool| (id, u32::from(value));
        let samples_lights = self.samples_lights() && settings.max_depth > 1 && settings.light_sampling;
        let mut common = vec![
            (0, workgroup_size),
            (1, settings.sampler as u32),
            (5, self.families),
            flag(9, settings.features),
            flag(13, settings.light_sampling),
            (14, settings.bsdf_sampling as u32),
            (26, self.neubrdf_queues),
            // Directions that are shared have the density that their material says.
            (27, settings.roulette_after.max(u32::from(settings.shares_paths()))),
            flag(39, settings.shares_paths()),
            (35, settings.clamp_indirect.unwrap_or(0.0).to_bits()),
            // Without light samples a vertex evaluates the direction that it goes on to, and no other.
            (34, if samples_lights { 2 } else { 1 }),
        ];
        common.extend(self.flags().map(|(id, has, _)| flag(id, has)));
        let [closest, shadow, reuse] = trace_kernels(traversal);
        let names = [
            Some("generate"),
            Some(closest),
            settings.features.then_some("first_hit"),
            self.environment.then_some("shade_miss"),
        ]
        .into_iter()
        .chain(Family::ALL.map(|family| self.has(family).then_some(shade_kernel(family))))
        .chain([
            samples_lights.then_some(shadow),
            settings.shares_paths().then_some(reuse),
            settings.shares_paths().then_some("reuse_paths"),
            Some("resolve"),
            Some("estimate_error"),
        ]);
        names.flatten().map(|name| KernelPlan { name, specialization: common.clone() }).collect()
    }
}

/// Whether a material emits by a texture that is not black: paths find that also where no triangle is worth sampling.
fn glows(material: &Material, scene: &Scene) -> bool {
    let is_black =
        |texture: u32| scene.textures[texture as usize].texels.iter().all(|texel| texel[..3] == [f16::ZERO; 3]);
    material.is_emissive() && material.emission_texture.is_some_and(|texture| !is_black(texture))
}

fn is_spatial(surface: &Surface, brdfs: &[Arc<Brdf>]) -> bool {
    matches!(surface, Surface::Measured { brdf } if brdfs[*brdf as usize].is_spatial())
}

/// Whether a traversal has to look at instances: there are more than one, or one that is not where its mesh is.
pub(super) fn is_instanced(scene: &Scene) -> bool {
    scene.instances.len() != 1 || scene.instances[0].object_to_world != Affine3A::IDENTITY
}

/// The built kernels of a render.
pub struct Kernels {
    kernels: Vec<Kernel>,
    traversal: Traversal,
}

impl Kernels {
    /// Builds what the scene needs, several at once, with further constants that hang on how the scene was uploaded; the one that shades NeuBRDFs
    /// for each of these shapes.
    pub fn build(
        device: &Arc<Device>,
        features: &Features,
        traversal: Traversal,
        settings: &Settings,
        further: &[(u32, u32)],
        shapes: &[NeuBrdfShape],
    ) -> Result<Kernels, Error> {
        let profile = device.profile();
        let mut plans = Vec::new();
        for mut plan in features.kernels(traversal, settings, profile.workgroup_size) {
            plan.specialization.push((32, u32::from(profile.reserves_by_workgroup)));
            plan.specialization.extend(further);
            let KernelPlan { name, specialization } = &plan;
            match *name == shade_kernel(Family::NeuBrdf) {
                true => plans.extend(shapes.iter().map(|shape| KernelPlan {
                    name,
                    specialization: [specialization, &shape.specialization()[..]].concat(),
                })),
                false => plans.push(plan),
            }
        }
        let sources = plans
            .iter()
            .map(|plan| {
                let source = gpu::spirv::load(plan.name).ok_or(Error::MissingKernel(plan.name))?;
                Ok((source, plan.specialization.as_slice()))
            })
            .collect::<Result<Vec<_>, Error>>()?;
        Ok(Kernels { kernels: Kernel::build_all(device, &sources)?, traversal })
    }

    /// Their names, in the order of [`Features::kernels`]; that of a kernel of several shapes is there as often.
    pub fn names(&self) -> Vec<&'static str> {
        self.kernels.iter().map(Kernel::name).collect()
    }

    /// A kernel by name; `None` if the scene has no use for it.
    pub fn get(&self, name: &str) -> Option<&Kernel> {
        self.kernels.iter().find(|kernel| kernel.name() == name)
    }

    /// The one of a name that was built for that shape, by its place among those shapes.
    pub fn of_shape(&self, name: &str, shape: usize) -> Option<&Kernel> {
        self.kernels.iter().filter(|kernel| kernel.name() == name).nth(shape)
    }

    /// The kernel that finds first hits.
    pub fn trace_closest(&self) -> &'static str {
        trace_kernels(self.traversal)[0]
    }

    /// The kernel that tests light samples for occlusion.
    pub fn trace_shadow(&self) -> &'static str {
        trace_kernels(self.traversal)[1]
    }

    /// The kernel that tests what pixels could share for occlusion.
    pub fn trace_reuse(&self) -> &'static str {
        trace_kernels(self.traversal)[2]
    }
}

fn trace_kernels(traversal: Traversal) -> [&'static str; 3] {
    match traversal {
        Traversal::RayQuery => ["trace_closest_ray_query", "trace_shadow_ray_query", "trace_reuse_ray_query"],
        Traversal::Bvh => ["trace_closest_bvh", "trace_shadow_bvh", "trace_reuse_bvh"],
    }
}

/// The kernel that shades a family.
pub fn shade_kernel(family: Family) -> &'static str {
    match family {
        Family::Diffuse => "shade_diffuse",
        Family::Conductor => "shade_conductor",
        Family::Dielectric => "shade_dielectric",
        Family::Coated => "shade_coated",
        Family::Nbrdf => "shade_nbrdf",
        Family::Layered => "shade_layered",
        Family::Woven => "shade_woven",
        Family::Merl => "shade_merl",
        Family::Rgl => "shade_rgl",
        Family::Sparse => "shade_sparse",
        Family::NeuBrdf => "shade_neubrdf",
    }
}
