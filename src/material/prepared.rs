//! What is found out about a surface once, before it is evaluated.

use std::sync::Arc;

use glam::{DVec3, Vec2};

use super::{CoatAlbedo, Dielectric, Evaluate, Ggx, LayeredWalk, fit_lobe};
use crate::scene::brdf::{Footprint, NeuBrdf, SurfaceFrame};
use crate::scene::{Brdf, Fresnel, Material, SamplingLobe, Surface};

/// Walks through a layered surface, a pair of directions, that its lobe is fitted to.
const FIT_WALKS: u32 = 4;

/// A surface with all that evaluating and sampling it takes, but its colour at a point.
#[derive(Clone, Debug)]
pub enum Prepared {
    /// [`Surface::Diffuse`]
    Diffuse,
    /// [`Surface::Conductor`]
    Conductor {
        /// Its reflectance; Schlick's is the colour's to say.
        fresnel: Fresnel,
        /// `None`: a mirror.
        roughness: Option<Ggx>,
    },
    /// [`Surface::Dielectric`]
    Dielectric(Dielectric),
    /// [`Surface::Coated`]
    Coated {
        /// Index of refraction of the coat.
        ior: f64,
        /// Of the coat; `None`: a mirror.
        roughness: Option<Ggx>,
        /// How much the coat reflects; where a map says how rough it is, how much a smooth one does, and behind it
        /// [`CoatAlbedo::of_all_roughnesses`].
        coats: Vec<CoatAlbedo>,
    },
    /// A BRDF without a sampler of its own, and the lobe that samples it.
    LobeSampled {
        /// The values.
        brdf: Arc<dyn Evaluate>,
        /// Roughly their shape.
        lobe: SamplingLobe,
    },
}

impl Prepared {
    /// Prepares a surface of a scene with these BRDFs. It may cost a second: do it once a material.
    pub fn new(surface: &Surface, brdfs: &[Arc<Brdf>]) -> Prepared {
        match *surface {
            Surface::Diffuse { .. } => Prepared::Diffuse,
            Surface::Conductor { fresnel, alpha } => Prepared::Conductor { fresnel, roughness: Ggx::new(alpha) },
            Surface::Dielectric { ior, alpha } => Prepared::Dielectric(Dielectric::new(ior, alpha)),
            Surface::Coated { ior, alpha, .. } => Prepared::Coated {
                ior: ior.into(),
                roughness: Ggx::new(Vec2::splat(alpha)),
                coats: vec![CoatAlbedo::new(ior, alpha)],
            },
            Surface::Measured { brdf } => {
                let brdf = brdfs[brdf as usize].clone();
                Prepared::LobeSampled { lobe: sampling_lobe(&brdf), brdf }
            }
            Surface::Layered(layers) => {
                let walk = LayeredWalk::new(&layers);
                let lobe = fit_lobe(walk.is_isotropic(), &|wo, wi| walk.average(wo, wi, FIT_WALKS));
                Prepared::LobeSampled { brdf: Arc::new(walk), lobe }
            }
            Surface::Woven(cloth) => {
                let lobe = fit_lobe(cloth.is_isotropic(), &|wo, wi| cloth.eval(wo, wi));
                Prepared::LobeSampled { brdf: Arc::new(cloth), lobe }
            }
        }
    }

    /// Prepares a material of such a scene, of which a map may say how rough it is.
    pub fn of(material: &Material, brdfs: &[Arc<Brdf>]) -> Prepared {
        match material.surface {
            Surface::Coated { ior, .. } if material.roughness_map.is_some() => {
                let mut coats = vec![CoatAlbedo::new(ior, 0.0)];
                coats.extend(CoatAlbedo::of_all_roughnesses(ior));
                Prepared::Coated { ior: ior.into(), roughness: None, coats }
            }
            ref surface => Prepared::new(surface, brdfs),
        }
    }

    /// Prepares all materials of a scene with these BRDFs, in their order; those that differ by no more than their colour
    /// share what was prepared.
    pub fn all(materials: &[Material], brdfs: &[Arc<Brdf>]) -> Vec<Arc<Prepared>> {
        let mut prepared: Vec<Arc<Prepared>> = Vec::new();
        for (index, material) in materials.iter().enumerate() {
            let known = materials[..index].iter().position(|known| is_alike(known, material));
            prepared.push(match known {
                Some(known) => prepared[known].clone(),
                None => Arc::new(Prepared::of(material, brdfs)),
            });
        }
        prepared
    }
}

/// Whether two materials scatter alike but for their colour and what maps say, so that what was prepared for one serves the other.
pub fn is_alike(a: &Material, b: &Material) -> bool {
    let is_mapped = a.roughness_map.is_some();
    if is_mapped != b.roughness_map.is_some() {
        return false;
    }
    match (&a.surface, &b.surface) {
        (Surface::Diffuse { .. }, Surface::Diffuse { .. }) => true,
        (Surface::Coated { ior, alpha, .. }, Surface::Coated { ior: other_ior, alpha: other_alpha, .. }) => {
            ior == other_ior && (is_mapped || alpha == other_alpha)
        }
        (a, b) => a == b,
    }
}

/// The lobe that comes with a BRDF, or that fits it.
fn sampling_lobe(brdf: &Brdf) -> SamplingLobe {
    match brdf {
        Brdf::Nbrdf(_) | Brdf::Merl(_) | Brdf::Rgl(_) | Brdf::Sparse(_) => {
            fit_lobe(brdf.is_isotropic(), &|wo, wi| brdf.eval(wo, wi))
        }
        Brdf::NeuBrdf(neubrdf) => neubrdf.lobe,
    }
}

impl Evaluate for Brdf {
    fn eval(&self, wo: DVec3, wi: DVec3) -> DVec3 {
        match self {
            Brdf::Nbrdf(nbrdf) => nbrdf.eval(wo, wi),
            Brdf::Merl(merl) => merl.eval(wo, wi),
            Brdf::Rgl(rgl) => rgl.eval(wo, wi),
            Brdf::Sparse(sparse) => sparse.eval(wo, wi),
            Brdf::NeuBrdf(neubrdf) => neubrdf.eval(wo, wi),
        }
    }

    fn eval_at(&self, footprint: Footprint, wo: DVec3, wi: DVec3) -> DVec3 {
        match self {
            Brdf::NeuBrdf(neubrdf) => neubrdf.eval_at(footprint, wo, wi),
            _ => self.eval(wo, wi),
        }
    }

    fn neubrdf(&self) -> Option<&NeuBrdf> {
        if let Brdf::NeuBrdf(neubrdf) = self { Some(neubrdf) } else { None }
    }

    fn is_spatial(&self) -> bool {
        Brdf::is_spatial(self)
    }

    fn frame(&self, footprint: Footprint) -> Option<SurfaceFrame> {
        match self {
            Brdf::NeuBrdf(neubrdf) => neubrdf.surface.as_ref()?.frame(footprint),
            _ => None,
        }
    }

    fn is_isotropic(&self) -> bool {
        match self {
            Brdf::Nbrdf(_) | Brdf::Merl(_) => true,
            Brdf::Rgl(rgl) => rgl.tables().is_isotropic(),
            Brdf::Sparse(sparse) => sparse.is_isotropic(),
            Brdf::NeuBrdf(neubrdf) => neubrdf.is_isotropic_about_z(),
        }
    }

    fn is_isotropic_in_frames(&self) -> bool {
        if let Brdf::NeuBrdf(neubrdf) = self { neubrdf.is_isotropic } else { self.is_isotropic() }
    }
}
