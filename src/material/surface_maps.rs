//! Surfaces whose parameters textures give, evaluated by definition.
//!
//! At a place the surface is what the maps say there, about the mapped normal n′ and with its tangent along the mapped direction. What it
//! reflects of a light is what it receives, cos θ′i about n′, and the renderer multiplies by cos θi about the surface's own normal: so
//! f = f′(ωo′, ωi′) r(ωi), with r of [`SurfaceFrame::received`]; nothing where a direction is below the frame. It never reflects more than f′ does.

use glam::{DVec2, DVec3, Vec2};

use super::frame::map_vector;
use super::{Bsdf, Evaluate, Prepared, color};
use crate::scene::brdf::{Footprint, SurfaceFrame};
use crate::scene::{Material, Surface, SurfaceMaps, Texture};

/// Smoother surfaces are taken to have this α: nothing could be learned of a mirror.
const LEAST_ALPHA: f32 = 0.02;
/// Points that the average over a footprint is taken over.
const AVERAGED: u32 = 64;

/// A surface with maps, ready to be evaluated.
#[derive(Debug)]
pub struct VaryingSurface {
    maps: SurfaceMaps,
    prepared: Prepared,
    /// Of the directions of anisotropy ψ, cos 2ψ and sin 2ψ: these can be interpolated.
    doubled: Option<Texture>,
}

impl VaryingSurface {
    /// Prepares it, which may take seconds where a coat's roughness varies.
    pub fn new(maps: SurfaceMaps) -> VaryingSurface {
        let mut surface = maps.surface.clone();
        match &mut surface {
            Surface::Conductor { alpha, .. } => *alpha = alpha.max(Vec2::splat(LEAST_ALPHA)),
            Surface::Coated { alpha, .. } => *alpha = alpha.max(LEAST_ALPHA),
            _ => {}
        }
        let roughness_map = maps.roughness.as_ref().map(|_| 0);
        let prepared = Prepared::of(&Material { roughness_map, ..Material::new("", surface) }, &[]);
        let doubled = maps.direction.clone().map(Texture::of_doubled_angles);
        VaryingSurface { maps, prepared, doubled }
    }

    /// Texels across and down of its largest map.
    pub fn size(&self) -> [u32; 2] {
        let sizes = self.maps.textures().map(|map| [map.width, map.height]);
        sizes.max_by_key(|[width, height]| width * height).unwrap_or([1, 1])
    }

    /// f(wo, wi) at a point.
    fn point(&self, uv: DVec2, wo: DVec3, wi: DVec3) -> DVec3 {
        let frame = self.frame_at(uv);
        let Some(([wo, leaning], received)) = frame.turned(wo, wi) else { return DVec3::ZERO };
        let sample = |map: &Texture| map.sample(uv.as_vec2());
        let tint = self.maps.color.as_ref().map_or(DVec3::ONE, |map| sample(map).as_dvec3());
        let color = color(&self.maps.surface).value.as_dvec3() * tint;
        let bsdf = match &self.maps.roughness {
            Some(map) => {
                let roughness = sample(map).truncate().max(Vec2::splat(LEAST_ALPHA.sqrt()));
                Bsdf::of_roughness(&self.prepared, color, roughness)
            }
            None => Bsdf::new(&self.prepared, color),
        };
        bsdf.eval(wo, leaning) * received
    }

    /// The frame at a point.
    fn frame_at(&self, uv: DVec2) -> SurfaceFrame {
        let sample = |map: &Texture| map.sample(uv.as_vec2()).as_dvec3();
        let normal = self.maps.normal.as_ref().map(|map| map_vector(sample(map)));
        let doubled = self.doubled.as_ref().map(|map| sample(map).truncate());
        let frame = SurfaceFrame { normal: normal.unwrap_or(DVec3::Z), doubled: doubled.unwrap_or(DVec2::X) };
        // Between texels directions are shorter than 1.
        SurfaceFrame::average(std::iter::once((1.0, frame)))
    }
}

/// Points that fill a square about a place: the place alone where the square is a point.
fn points(center: DVec2, extent: f64) -> impl ExactSizeIterator<Item = DVec2> {
    // A Kronecker sequence (Roberts 2018).
    let step = DVec2::new(0.754_877_666_246_692_7, 0.569_840_290_998_053_2);
    (0..if extent == 0.0 { 1 } else { AVERAGED })
        .map(move |i| center + ((0.5 + f64::from(i) * step).fract() - 0.5) * extent)
}

impl Evaluate for VaryingSurface {
    fn eval(&self, wo: DVec3, wi: DVec3) -> DVec3 {
        self.eval_at(Footprint::WHOLE, wo, wi)
    }

    /// The average over a square about the place.
    fn eval_at(&self, footprint: Footprint, wo: DVec3, wi: DVec3) -> DVec3 {
        let points = points(footprint.uv, footprint.area.min(1.0).sqrt());
        let count = points.len() as f64;
        points.map(|uv| self.point(uv, wo, wi)).sum::<DVec3>() / count
    }

    /// Of the maps that give one; a look-up of these has averaged a texel's worth already.
    fn frame(&self, footprint: Footprint) -> Option<SurfaceFrame> {
        let largest = self.maps.frames().map(|map| map.width * map.height).max()?;
        let extent = (footprint.area.min(1.0) - 1.0 / f64::from(largest)).max(0.0).sqrt();
        Some(SurfaceFrame::average(points(footprint.uv, extent).map(|uv| (1.0, self.frame_at(uv)))))
    }

    fn is_spatial(&self) -> bool {
        true
    }

    fn is_isotropic(&self) -> bool {
        self.is_isotropic_in_frames() && self.maps.normal.is_none()
    }

    fn is_isotropic_in_frames(&self) -> bool {
        match (&self.maps.surface, &self.maps.roughness) {
            (Surface::Conductor { .. }, Some(map)) => map.texels.iter().all(|[red, green, ..]| red == green),
            (Surface::Conductor { alpha, .. }, None) => alpha.x == alpha.y,
            _ => true,
        }
    }
}
