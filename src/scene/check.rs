//! Whether a scene that a program put together keeps what its types' documentation asks: the files' readers check as they read.

use glam::Vec3;

use super::light::BRIGHTEST;
use super::mesh::LARGEST_COORDINATE;
use super::{
    Brdf, Camera, Environment, Film, Fresnel, Instance, LayerBase, Layered, Material, Mesh, Opacity, Scene, Sun,
    Surface, TexturePlacement, Woven, Yarn,
};

/// A part of a scene that is not as it must be.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{part} is {found}, but must be {expected}")]
pub struct Flaw {
    /// Which part.
    pub part: String,
    /// What it is.
    pub found: String,
    /// What it may be.
    pub expected: String,
}

fn ensure(holds: bool, part: impl FnOnce() -> String, found: impl ToString, expected: &str) -> Result<(), Flaw> {
    if holds {
        return Ok(());
    }
    Err(Flaw { part: part(), found: found.to_string(), expected: expected.to_string() })
}

/// Index in [0, count).
fn ensure_index(part: impl FnOnce() -> String, index: u32, count: usize) -> Result<(), Flaw> {
    ensure((index as usize) < count, part, index, &format!("below {count}"))
}

fn is_radiance(value: Vec3) -> bool {
    value.is_finite() && value.min_element() >= 0.0 && value.max_element() <= BRIGHTEST
}

fn is_share(value: Vec3) -> bool {
    value.is_finite() && value.min_element() >= 0.0 && value.max_element() <= 1.0
}

/// A NeuBRDF's indices become places in the device's memory.
pub(crate) fn check_brdf(brdf: &Brdf) -> Result<(), Flaw> {
    let Brdf::NeuBrdf(model) = brdf else { return Ok(()) };
    model.validate().map_err(|flaw| Flaw {
        part: format!("{} of a NeuBRDF", flaw.field),
        found: flaw.found,
        expected: flaw.expected,
    })
}

/// What positions are expected to be.
const POSITIONS: &str = "of coordinates up to 10⁸";

fn are_positions(positions: &[Vec3]) -> bool {
    positions.iter().all(|position| position.is_finite() && position.abs().max_element() <= LARGEST_COORDINATE)
}

fn check_fresnel(fresnel: &Fresnel, part: impl Fn(&str) -> String) -> Result<(), Flaw> {
    match fresnel {
        Fresnel::Schlick { f0 } => ensure(is_share(f0.value), || part("F₀"), f0.value, "in [0, 1]"),
        Fresnel::Complex { eta, kappa } => {
            let fine = eta.is_finite() && eta.min_element() > 0.0;
            ensure(fine, || part("η"), eta, "finite and above 0")?;
            let fine = kappa.is_finite() && kappa.min_element() >= 0.0;
            ensure(fine, || part("κ"), kappa, "finite and not negative")
        }
    }
}

fn check_layers(layers: &Layered, part: impl Fn(&str) -> String) -> Result<(), Flaw> {
    let [least, most] = Layered::IOR;
    let range = format!("in [{least}, {most}]");
    ensure((least..=most).contains(&layers.ior), || part("index of refraction"), layers.ior, &range)?;
    let rough = |alpha: f32| (Layered::LEAST_ALPHA..=1.0).contains(&alpha);
    let range = format!("in [{}, 1]", Layered::LEAST_ALPHA);
    ensure(rough(layers.alpha), || part("α"), layers.alpha, &range)?;
    let absorption = layers.absorption;
    let fine = absorption.is_finite() && absorption.min_element() >= 0.0 && absorption.max_element() <= 100.0;
    ensure(fine, || part("absorption"), absorption, "in [0, 100]")?;
    match &layers.base {
        LayerBase::Diffuse { albedo } => ensure(is_share(*albedo), || part("albedo of the base"), albedo, "in [0, 1]"),
        LayerBase::Conductor { fresnel, alpha } => {
            check_fresnel(fresnel, &part)?;
            ensure(rough(alpha.x) && rough(alpha.y), || part("α of the base"), alpha, &range)
        }
    }
}

fn check_yarn(yarn: &Yarn, part: impl Fn(&str) -> String) -> Result<(), Flaw> {
    for (what, share) in [("coverage", yarn.coverage), ("gloss", yarn.gloss), ("isotropy", yarn.isotropy)] {
        ensure((0.0..=1.0).contains(&share), || part(what), share, "in [0, 1]")?;
    }
    for (what, color) in [("F₀", yarn.f0), ("albedo", yarn.albedo)] {
        ensure(is_share(color), || part(what), color, "in [0, 1]")?;
    }
    for (what, width) in [("specular width", yarn.specular_width), ("volume width", yarn.volume_width)] {
        ensure((0.02..=1.0).contains(&width), || part(what), width, "in [0.02, 1]")?;
    }
    Ok(())
}

impl Scene {
    /// Checks everything that a renderer relies on, in time linear in the scene.
    ///
    /// # Errors
    /// The first flaw found.
    pub fn check(&self) -> Result<(), Flaw> {
        self.camera.check()?;
        let film = self.film;
        ensure(
            [film.width, film.height].iter().all(|side| (1..=Film::LONGEST_SIDE).contains(side)),
            || "film".into(),
            format!("{}x{}", film.width, film.height),
            &format!("from 1 to {} pixels to a side", Film::LONGEST_SIDE),
        )?;
        ensure(!self.materials.is_empty(), || "number of materials".into(), 0, "at least 1")?;
        for (index, texture) in self.textures.iter().enumerate() {
            let (size, texels) = (u64::from(texture.width) * u64::from(texture.height), texture.texels.len());
            let part = || format!("number of texels of texture {index} ({})", texture.name);
            ensure(size > 0 && size == texels as u64, part, texels, &format!("its size, {size}, and not 0"))?;
            let TexturePlacement { scale, offset } = texture.placement;
            let part = || format!("placement of texture {index} ({})", texture.name);
            ensure(scale.is_finite() && offset.is_finite(), part, format!("{scale} and {offset}"), "finite numbers")?;
        }
        self.brdfs.iter().try_for_each(|brdf| check_brdf(brdf))?;
        for (index, material) in (0..).zip(&self.materials) {
            self.check_material(index, material)?;
        }
        for (index, mesh) in self.meshes.iter().enumerate() {
            self.check_mesh(index, mesh)?;
        }
        self.check_instances(&self.instances)?;
        self.environment.as_ref().map_or(Ok(()), Environment::check)?;
        self.sun.as_ref().map_or(Ok(()), Sun::check)
    }

    /// The instance of that index.
    ///
    /// # Errors
    /// There is none.
    pub fn instance(&self, index: u32) -> Result<&Instance, Flaw> {
        let flaw = || Flaw {
            part: "index of an instance".into(),
            found: index.to_string(),
            expected: format!("below {}", self.instances.len()),
        };
        self.instances.get(index as usize).ok_or_else(flaw)
    }

    /// Checks instances of this scene's meshes.
    ///
    /// # Errors
    /// None at all, or one that cannot stand there.
    pub fn check_instances(&self, instances: &[Instance]) -> Result<(), Flaw> {
        ensure(!instances.is_empty(), || "number of instances".into(), 0, "at least 1")?;
        (0..).zip(instances).try_for_each(|(index, instance)| self.check_instance(index, instance))
    }

    /// Checks one instance of this scene's meshes; `index` is for the message.
    ///
    /// # Errors
    /// A mesh that is not there, a transform without an inverse or with numbers that are not finite.
    pub fn check_instance(&self, index: u32, instance: &Instance) -> Result<(), Flaw> {
        ensure_index(|| format!("mesh of instance {index}"), instance.mesh, self.meshes.len())?;
        let transform = &instance.object_to_world;
        let determinant = transform.matrix3.as_dmat3().determinant();
        ensure(
            transform.is_finite() && determinant != 0.0 && determinant.is_finite(),
            || format!("transform of instance {index}"),
            format!("{:?}", transform.to_cols_array()),
            "finite and invertible",
        )
    }

    /// Checks a material for the place `index` of this scene, which has to be there.
    ///
    /// # Errors
    /// A number out of range, a texture or a BRDF that is not there.
    pub fn check_material(&self, index: u32, material: &Material) -> Result<(), Flaw> {
        let part = |what: &str| format!("{what} of material {index} ({})", material.name);
        ensure_index(|| "index of a material".into(), index, self.materials.len())?;
        ensure(is_radiance(material.emission), || part("emission"), material.emission, "in [0, 10¹²]")?;
        if let Some(color) = material.surface.color() {
            ensure(is_share(color.value), || part("colour"), color.value, "in [0, 1]")?;
        }
        for texture in material.textures() {
            ensure_index(|| part("texture"), texture, self.textures.len())?;
        }
        let Opacity { value, .. } = material.opacity;
        ensure((0.0..=1.0).contains(&value), || part("opacity"), value, "in [0, 1]")?;
        let fine = material.opacity.is_whole() || !material.is_emissive();
        ensure(fine, || part("opacity"), format!("{value}, or a texture"), "1, and no texture, as it emits")?;
        let fine = material.roughness_map.is_none() || material.surface.takes_roughness_map();
        ensure(
            fine,
            || part("surface"),
            "one that no map of roughness can vary",
            "metal, glass or coated, or without such a map",
        )?;
        let has_directions = material.anisotropy_direction_map.is_some();
        ensure(
            !has_directions || material.surface.takes_anisotropy_direction_map(),
            || part("surface"),
            "one that no map of anisotropy can turn",
            "metal, measured, layered or woven, or without such a map",
        )?;
        let is_plain = |material: &Material| material.patches.is_none() && !material.is_emissive();
        let stands_in_patches =
            || self.materials.iter().any(|other| other.patches.is_some_and(|p| p.material == index));
        if let Some(patches) = material.patches {
            ensure_index(|| part("patches"), patches.material, self.materials.len())?;
            ensure(!material.is_emissive(), || part("patches"), "there", "none, as it emits")?;
            let fine = patches.material != index && is_plain(&self.materials[patches.material as usize]);
            ensure(fine, || part("patches"), "of a material that emits or has patches", "of another one")?;
        }
        let fine = is_plain(material) || !stands_in_patches();
        ensure(fine, || part("emission and patches"), "there", "none, as it stands in another one's patches")?;
        let alpha_is_fine = |alpha: f32| (0.0..=1.0).contains(&alpha);
        match &material.surface {
            Surface::Diffuse { .. } => Ok(()),
            Surface::Conductor { fresnel, alpha } => {
                check_fresnel(fresnel, part)?;
                ensure(alpha_is_fine(alpha.x) && alpha_is_fine(alpha.y), || part("α"), alpha, "in [0, 1]")
            }
            Surface::Dielectric { ior, alpha } => {
                ensure((0.1..=10.0).contains(ior), || part("index of refraction"), ior, "in [0.1, 10]")?;
                ensure(alpha_is_fine(*alpha), || part("α"), alpha, "in [0, 1]")
            }
            Surface::Coated { ior, alpha, .. } => {
                ensure((1.0..=10.0).contains(ior), || part("index of refraction"), ior, "in [1, 10]")?;
                ensure(alpha_is_fine(*alpha), || part("α"), alpha, "in [0, 1]")
            }
            Surface::Measured { brdf } => ensure_index(|| part("BRDF"), *brdf, self.brdfs.len()),
            Surface::Layered(layers) => check_layers(layers, part),
            Surface::Woven(Woven { warp, weft }) => {
                let coverage = warp.coverage + weft.coverage;
                ensure(coverage <= 1.0, || part("sum of the coverages"), coverage, "at most 1")?;
                check_yarn(warp, part)?;
                check_yarn(weft, part)
            }
        }
    }

    /// Checks other vertices for the mesh of that index, which has to be there: as many as it has.
    ///
    /// # Errors
    /// Another number of them, or positions that are not finite or too far away.
    pub fn check_vertices(&self, index: u32, positions: &[Vec3], normals: &[Vec3]) -> Result<(), Flaw> {
        ensure_index(|| "index of a mesh".into(), index, self.meshes.len())?;
        let mesh = &self.meshes[index as usize];
        let part = |what: &str| format!("{what} of mesh {index} ({})", mesh.name);
        for (what, found, had) in [
            ("number of positions", positions.len(), mesh.positions.len()),
            ("number of normals", normals.len(), mesh.normals.len()),
        ] {
            ensure(found == had, || part(what), found, &format!("{had}, as before"))?;
        }
        ensure(are_positions(positions), || part("a position"), "not finite, or beyond", POSITIONS)
    }

    fn check_mesh(&self, index: usize, mesh: &Mesh) -> Result<(), Flaw> {
        let part = |what: &str| format!("{what} of mesh {index} ({})", mesh.name);
        let count = mesh.positions.len();
        ensure(are_positions(&mesh.positions), || part("a position"), "not finite, or beyond", POSITIONS)?;
        for (what, length) in [("number of normals", mesh.normals.len()), ("number of uvs", mesh.uvs.len())] {
            ensure(length == 0 || length == count, || part(what), length, &format!("0, or {count} as the positions"))?;
        }
        let fine = mesh.uvs.iter().all(|uv| uv.is_finite());
        ensure(fine, || part("a texture coordinate"), "not finite", "finite")?;
        let vertex = mesh.triangles.iter().flatten().find(|vertex| **vertex as usize >= count);
        vertex.map_or(Ok(()), |vertex| ensure_index(|| part("a vertex index"), *vertex, count))?;
        let materials = mesh.materials.len();
        ensure(
            materials == 1 || materials == mesh.triangles.len() || mesh.triangles.is_empty(),
            || part("number of materials"),
            materials,
            &format!("1, or {} as the triangles", mesh.triangles.len()),
        )?;
        let material = mesh.materials.iter().find(|material| **material as usize >= self.materials.len());
        material.map_or(Ok(()), |index| ensure_index(|| part("a material"), *index, self.materials.len()))
    }
}

impl Camera {
    /// # Errors
    /// A view without a direction, or numbers out of range.
    pub fn check(&self) -> Result<(), Flaw> {
        let numbers = [self.eye, self.target, self.up];
        ensure(numbers.iter().all(|v| v.is_finite()), || "camera".into(), format!("{numbers:?}"), "finite")?;
        let axis = self.target.as_dvec3() - self.eye.as_dvec3();
        ensure(axis.length() > 0.0, || "camera's target".into(), self.target, "apart from its eye")?;
        let side = axis.normalize().cross(self.up.as_dvec3());
        ensure(side.length() > 0.0, || "camera's up".into(), self.up, "not along its view")?;
        let angle = self.vertical_fov_degrees;
        ensure(angle > 0.0 && angle < 180.0, || "camera's field of view".into(), angle, "in (0, 180) degrees")?;
        let Some(lens) = self.lens else { return Ok(()) };
        let fine = |length: f32| length.is_finite() && length > 0.0;
        ensure(fine(lens.radius), || "lens radius".into(), lens.radius, "above 0")?;
        ensure(fine(lens.focus_distance), || "focus distance".into(), lens.focus_distance, "above 0")
    }
}

impl Environment {
    /// # Errors
    /// No texels, not as many as the size says, or radiance out of range.
    pub fn check(&self) -> Result<(), Flaw> {
        let (size, texels) = (u64::from(self.width) * u64::from(self.height), self.texels.len());
        let part = || "number of texels of the environment".to_string();
        ensure(size > 0 && size == texels as u64, part, texels, &format!("its size, {size}, and not 0"))?;
        let wrong = self.texels.iter().find(|texel| !is_radiance(**texel));
        wrong.map_or(Ok(()), |texel| ensure(false, || "a texel of the environment".into(), texel, "in [0, 10¹²]"))?;
        let turn = self.rotation_degrees;
        ensure(turn.is_finite(), || "rotation of the environment".into(), turn, "finite")
    }
}

impl Sun {
    /// # Errors
    /// A direction that is no unit vector, or irradiance out of range.
    pub fn check(&self) -> Result<(), Flaw> {
        ensure(self.direction.is_normalized(), || "direction of the sun".into(), self.direction, "a unit vector")?;
        ensure(is_radiance(self.irradiance), || "irradiance of the sun".into(), self.irradiance, "in [0, 10¹²]")
    }
}
