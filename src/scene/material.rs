//! What a scene says about its materials. What they do to light is `crate::material`.

use glam::{Vec2, Vec3};

use super::{Layered, Scene, Woven};

/// A named material.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// The OBJ material name.
    pub name: String,
    /// How it scatters.
    pub surface: Surface,
    /// Emitted radiance, W·sr⁻¹·m⁻², in [0, 10¹²].
    pub emission: Vec3,
    /// Index into [`super::Scene::textures`] of a texture that multiplies it.
    pub emission_texture: Option<u32>,
    /// Emits from the back of its triangles too.
    pub emits_both_sides: bool,
    /// How much of it is there. What emits is whole.
    pub opacity: Opacity,
    /// Index into [`super::Scene::textures`] of shading normals: x along u, y along v, z along the triangle's own, each from −1 (0 in the texture)
    /// to 1.
    pub normal_map: Option<u32>,
    /// Index into [`super::Scene::textures`] of the roughness along u (red) and v (green), instead of the surface's own: α is its square. Of a
    /// [`Surface::takes_roughness_map`]; where that has one α, it is the mean of both.
    pub roughness_map: Option<u32>,
    /// Index into [`super::Scene::textures`] of the direction about the normal that "along u" turns into, as [`super::Texture::of_doubled_angles`] makes it:
    /// the cosine and sine of twice its angle, from u towards v. Of a [`Surface::takes_anisotropy_direction_map`].
    pub anisotropy_direction_map: Option<u32>,
    /// Where another material stands. What emits has no patches.
    pub patches: Option<Patches>,
}

/// Patches of another material: rust on paint, gold on a glaze.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Patches {
    /// Index into [`super::Scene::textures`]: they are where its first number is at least ½.
    pub map: u32,
    /// Index into [`super::Scene::materials`] of the other one, of which all counts but its opacity. It neither emits nor has patches itself.
    pub material: u32,
}

/// The probability with which a ray meets a surface; otherwise it goes on as if there were nothing. Leaves are cut out of their triangles by it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Opacity {
    /// In [0, 1].
    pub value: f32,
    /// Index into [`super::Scene::textures`] of a texture that multiplies it, by its first number.
    pub texture: Option<u32>,
}

/// A colour, optionally times a texture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Color {
    /// Linear Rec. 709, each in [0, 1].
    pub value: Vec3,
    /// Index into [`super::Scene::textures`].
    pub texture: Option<u32>,
}

/// The scattering models. Roughness is GGX's α along the tangent and the bitangent; 0 is perfectly smooth. Every
/// surface but [`Surface::Dielectric`] is opaque and looks the same from both sides.
#[derive(Clone, Debug, PartialEq)]
pub enum Surface {
    /// Lambertian.
    Diffuse {
        /// Reflectance.
        albedo: Color,
    },
    /// GGX over a metal; a mirror where α is 0.
    Conductor {
        /// Its reflectance.
        fresnel: Fresnel,
        /// GGX α along u and v, in [0, 1].
        alpha: Vec2,
    },
    /// Glass: the boundary of a solid whose outside is the front of its triangles.
    Dielectric {
        /// Index of refraction of the inside over that of the outside, in [0.1, 10].
        ior: f32,
        /// GGX α, in [0, 1].
        alpha: f32,
    },
    /// A diffuse base under a dielectric coat.
    Coated {
        /// Reflectance of the base.
        albedo: Color,
        /// Index of refraction of the coat, in [1, 10].
        ior: f32,
        /// GGX α of the coat, in [0, 1].
        alpha: f32,
    },
    /// A BRDF that a file gives.
    Measured {
        /// Index into [`super::Scene::brdfs`].
        brdf: u32,
    },
    /// A rough coat that absorbs, over a metal or a diffuse base, as light wanders between them.
    Layered(Layered),
    /// Cloth.
    Woven(Woven),
}

/// The reflectance of a metal against the angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fresnel {
    /// Schlick's approximation from the reflectance at normal incidence.
    Schlick {
        /// Reflectance at normal incidence.
        f0: Color,
    },
    /// The Fresnel equations with a complex index of refraction η + iκ.
    Complex {
        /// Real part, > 0.
        eta: Vec3,
        /// Extinction, ≥ 0.
        kappa: Vec3,
    },
}

impl Surface {
    /// The colour that a texture may multiply, where the model has one.
    pub(super) fn color(&self) -> Option<Color> {
        self.clone().color_mut().copied()
    }

    /// The same, to change it.
    pub(super) fn color_mut(&mut self) -> Option<&mut Color> {
        match self {
            Surface::Diffuse { albedo } | Surface::Coated { albedo, .. } => Some(albedo),
            Surface::Conductor { fresnel: Fresnel::Schlick { f0 }, .. } => Some(f0),
            Surface::Conductor { fresnel: Fresnel::Complex { .. }, .. }
            | Surface::Dielectric { .. }
            | Surface::Measured { .. }
            | Surface::Layered(_)
            | Surface::Woven(_) => None,
        }
    }

    /// Whether a map may say how rough it is.
    pub fn takes_roughness_map(&self) -> bool {
        matches!(self, Surface::Conductor { .. } | Surface::Dielectric { .. } | Surface::Coated { .. })
    }

    /// Whether it may look another way when it is turned about its normal, and a map may turn it.
    pub fn takes_anisotropy_direction_map(&self) -> bool {
        matches!(self, Surface::Conductor { .. } | Surface::Measured { .. } | Surface::Layered(_) | Surface::Woven(_))
    }

    /// Index into [`super::Scene::textures`] of the texture that its colour is multiplied by.
    pub fn texture(&self) -> Option<u32> {
        self.color()?.texture
    }
}

impl Color {
    /// A colour without a texture.
    pub const fn constant(value: Vec3) -> Color {
        Color { value, texture: None }
    }
}

impl Opacity {
    /// A surface without holes.
    pub const WHOLE: Opacity = Opacity { value: 1.0, texture: None };

    /// Whether no ray goes through.
    pub fn is_whole(&self) -> bool {
        *self == Opacity::WHOLE
    }
}

impl Scene {
    /// Whether some material lets rays through.
    pub fn has_holes(&self) -> bool {
        self.materials.iter().any(|material| !material.opacity.is_whole())
    }
}

impl Material {
    /// A material without holes that does not emit.
    pub fn new(name: impl Into<String>, surface: Surface) -> Material {
        Material {
            name: name.into(),
            surface,
            emission: Vec3::ZERO,
            emission_texture: None,
            emits_both_sides: false,
            opacity: Opacity::WHOLE,
            normal_map: None,
            roughness_map: None,
            anisotropy_direction_map: None,
            patches: None,
        }
    }

    /// Whether its triangles are lights.
    pub fn is_emissive(&self) -> bool {
        self.emission != Vec3::ZERO
    }

    /// The textures that it looks up: indices into [`super::Scene::textures`].
    pub fn textures(&self) -> impl Iterator<Item = u32> {
        let Material {
            emission_texture, opacity, normal_map, roughness_map, anisotropy_direction_map, patches, ..
        } = *self;
        let maps = [normal_map, roughness_map, anisotropy_direction_map, patches.map(|patches| patches.map)];
        [self.surface.texture(), emission_texture, opacity.texture].into_iter().chain(maps).flatten()
    }
}
