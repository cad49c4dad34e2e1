//! Surfaces whose parameters textures give, evaluated by definition.
//!
//! At a place the surface is what the maps say there, about the mapped normal n′. What it reflects of a light is what it receives, cos θ′i about
//! n′, and the renderer multiplies by cos θi about the surface's own normal: so f = f′(ωo′, ωi′) max(0, cos θ′i) / max(cos θi, 0.1), where the
//! bound keeps grazing light from being seen infinitely bright by facets that lean towards it. It never reflects more than f′ does.

use glam::{DVec2, DVec3, Vec2};
use rayon::prelude::*;

use super::{Bsdf, CoatAlbedo, Coated, Evaluate, Ggx, Prepared, color};
use crate::scene::brdf::Footprint;
use crate::scene::{Surface, SurfaceMaps, Texture};

/// Lowest cos θi that is divided by.
const LEAST_COSINE: f64 = 0.1;
/// Smoother surfaces are taken to have this α: nothing could be learned of a mirror.
const LEAST_ALPHA: f32 = 0.02;
/// Coats whose albedo is known, even in their roughness; a place takes the nearest.
const COATS: usize = 33;
/// Points that the average over a footprint is taken over.
const AVERAGED: u32 = 64;

/// A surface with maps, ready to be evaluated.
#[derive(Debug)]
pub struct VaryingSurface {
    maps: SurfaceMaps,
    coats: Vec<CoatAlbedo>,
}

impl VaryingSurface {
    /// Prepares it, which may take seconds where a coat's roughness varies.
    pub fn new(maps: SurfaceMaps) -> VaryingSurface {
        let coat = |alpha: f32| match maps.surface {
            Surface::Coated { albedo, ior, .. } => CoatAlbedo::new(&Surface::Coated { albedo, ior, alpha }),
            _ => CoatAlbedo::None,
        };
        let coats = match (&maps.surface, &maps.roughness) {
            (Surface::Coated { .. }, Some(_)) => {
                let alpha = |i: usize| (i as f32 / (COATS - 1) as f32).powi(2).max(LEAST_ALPHA);
                (0..COATS).into_par_iter().map(|i| coat(alpha(i))).collect()
            }
            (Surface::Coated { alpha, .. }, None) => vec![coat(alpha.max(LEAST_ALPHA))],
            _ => Vec::new(),
        };
        VaryingSurface { maps, coats }
    }

    /// Texels across and down of its largest map.
    pub fn size(&self) -> [u32; 2] {
        let sizes = self.maps.textures().map(|map| [map.width, map.height]);
        sizes.max_by_key(|[width, height]| width * height).unwrap_or([1, 1])
    }

    /// f(wo, wi) at a point.
    fn point(&self, uv: DVec2, wo: DVec3, wi: DVec3) -> DVec3 {
        let normal = self.normal(uv);
        let tangent = (DVec3::X - normal * normal.x).normalize();
        let bitangent = normal.cross(tangent);
        let local = |w: DVec3| DVec3::new(w.dot(tangent), w.dot(bitangent), w.dot(normal));
        let (wo, leaning) = (local(wo), local(wi));
        let sample = |map: &Texture| map.sample(uv.as_vec2());
        let tint = self.maps.color.as_ref().map_or(DVec3::ONE, |map| sample(map).as_dvec3());
        let color = color(&self.maps.surface).value.as_dvec3() * tint;
        let mapped = self.maps.roughness.as_ref().map(|map| sample(map).truncate());
        let alpha = |own: Vec2| mapped.map_or(own, |roughness| roughness * roughness).max(Vec2::splat(LEAST_ALPHA));
        let value = match self.maps.surface {
            Surface::Conductor { fresnel, alpha: own } => {
                let metal = Prepared::Conductor { fresnel, roughness: Ggx::new(alpha(own)) };
                Bsdf::new(&metal, color).eval(wo, leaning)
            }
            Surface::Coated { ior, alpha: own, .. } => {
                let alpha = alpha(Vec2::splat(own)).element_sum() / 2.0;
                let nearest = (alpha.sqrt() * (self.coats.len() - 1) as f32).round() as usize;
                let roughness = Ggx::new(Vec2::splat(alpha));
                Coated { base: color, ior: ior.into(), roughness, coat: &self.coats[nearest] }.eval(wo, leaning)
            }
            _ => Bsdf::new(&Prepared::Diffuse, color).eval(wo, leaning),
        };
        let received = if self.maps.normal.is_some() { leaning.z.max(0.0) / wi.z.max(LEAST_COSINE) } else { 1.0 };
        value * received
    }
}

impl Evaluate for VaryingSurface {
    fn eval(&self, wo: DVec3, wi: DVec3) -> DVec3 {
        self.eval_at(Footprint::WHOLE, wo, wi)
    }

    /// The average over a square about the place.
    fn eval_at(&self, footprint: Footprint, wo: DVec3, wi: DVec3) -> DVec3 {
        let extent = footprint.area.min(1.0).sqrt();
        if extent == 0.0 {
            return self.point(footprint.uv, wo, wi);
        }
        // A Kronecker sequence (Roberts 2018).
        let step = DVec2::new(0.754_877_666_246_692_7, 0.569_840_290_998_053_2);
        let point = |i: u32| footprint.uv + ((0.5 + f64::from(i) * step).fract() - 0.5) * extent;
        (0..AVERAGED).map(|i| self.point(point(i), wo, wi)).sum::<DVec3>() / f64::from(AVERAGED)
    }

    fn is_spatial(&self) -> bool {
        true
    }

    /// The mapped one.
    fn normal(&self, uv: DVec2) -> DVec3 {
        let mapped = self.maps.normal.as_ref().map(|map| (2.0 * map.sample(uv.as_vec2()) - 1.0).as_dvec3());
        // What a map has below the surface leans as far as can be.
        mapped.map_or(DVec3::Z, |n| n.with_z(n.z.max(0.05)).normalize())
    }

    fn is_isotropic(&self) -> bool {
        let is_round = match (&self.maps.surface, &self.maps.roughness) {
            (Surface::Conductor { .. }, Some(map)) => map.texels.iter().all(|[red, green, ..]| red == green),
            (Surface::Conductor { alpha, .. }, None) => alpha.x == alpha.y,
            _ => true,
        };
        is_round && self.maps.normal.is_none()
    }
}
