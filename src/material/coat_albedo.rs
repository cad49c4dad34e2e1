//! How much light a dielectric coat reflects, all directions together.

use std::f64::consts::FRAC_PI_2;

use glam::{DVec3, Vec2};
use rayon::prelude::*;

use super::{Ggx, INDEX_MATCH, fresnel_dielectric, fresnel_dielectric_average, reflect};

/// E(μ), the directional albedo of a coat at cos θ = μ, and its average 2∫E(μ)μ dμ.
#[derive(Clone, Debug, PartialEq)]
pub enum CoatAlbedo {
    /// No coat, or one that cannot be seen because its index is 1: E = 0.
    None,
    /// A smooth coat: E is the Fresnel reflectance.
    Smooth {
        /// Index of refraction.
        ior: f64,
        /// Of E.
        average: f64,
    },
    /// A rough coat: E by table.
    Rough {
        /// E at μ = (i / (len − 1))⁴, linear in ⁴√μ between; [`CoatAlbedo::TABLE_LEN`] of them. The fourth power is
        /// for small α, where E bends within μ < α.
        table: Vec<f32>,
        /// Of E as tabulated.
        average: f64,
    },
}

impl CoatAlbedo {
    /// The length of the table.
    pub const TABLE_LEN: usize = 256;

    /// The coat of an index of refraction and a GGX α. A rough one costs some 10⁶ evaluations: do it once a material.
    pub fn new(ior: f32, alpha: f32) -> CoatAlbedo {
        CoatAlbedo::by_quadrature(ior, alpha, [128, 48])
    }

    fn by_quadrature(ior: f32, alpha: f32, points: [u32; 2]) -> CoatAlbedo {
        if ior - 1.0 < INDEX_MATCH {
            return CoatAlbedo::None;
        }
        let ior = f64::from(ior);
        let Some(ggx) = Ggx::new(Vec2::splat(alpha)) else {
            return CoatAlbedo::Smooth { ior, average: fresnel_dielectric_average(ior) };
        };
        CoatAlbedo::tabulated(|cosine| albedo(ggx, ior, cosine, points))
    }

    fn tabulated(albedo: impl Fn(f64) -> f64 + Sync) -> CoatAlbedo {
        let last = (Self::TABLE_LEN - 1) as f64;
        let at = |i: usize| albedo((i as f64 / last).powi(4)) as f32;
        let table: Vec<f32> = (0..Self::TABLE_LEN).into_par_iter().map(at).collect();
        let average = average(&table);
        CoatAlbedo::Rough { table, average }
    }

    /// Coats of one index and α from 0 to 1, even in ⁴√α as tables are in ⁴√μ, for [`Coat::of_alpha`]; all of them are tables. They cost some
    /// 2·10⁷ evaluations.
    pub fn of_all_roughnesses(ior: f32) -> Vec<CoatAlbedo> {
        let last = (Self::ROUGHNESSES - 1) as f32;
        let coat = |i: usize| match CoatAlbedo::by_quadrature(ior, (i as f32 / last).powi(4), [64, 24]) {
            smooth @ CoatAlbedo::Smooth { .. } => CoatAlbedo::tabulated(|cosine| smooth.at(cosine)),
            other => other,
        };
        (0..Self::ROUGHNESSES).into_par_iter().map(coat).collect()
    }

    /// How many roughnesses coats are tabulated at, where a map gives them.
    pub const ROUGHNESSES: usize = 65;

    /// The table of a rough coat.
    pub fn table(&self) -> Option<&[f32]> {
        if let CoatAlbedo::Rough { table, .. } = self { Some(table) } else { None }
    }

    /// E(μ).
    pub fn at(&self, cosine: f64) -> f64 {
        match self {
            CoatAlbedo::None => 0.0,
            CoatAlbedo::Smooth { ior, .. } => fresnel_dielectric(cosine, *ior),
            CoatAlbedo::Rough { table, .. } => {
                let position = cosine.clamp(0.0, 1.0).sqrt().sqrt() * (table.len() - 1) as f64;
                let cell = (position as usize).min(table.len() - 2);
                let (low, high) = (f64::from(table[cell]), f64::from(table[cell + 1]));
                low + (high - low) * (position - cell as f64)
            }
        }
    }

    /// 2∫E(μ)μ dμ: the share of diffuse light that the coat reflects.
    pub fn average(&self) -> f64 {
        match self {
            CoatAlbedo::None => 0.0,
            CoatAlbedo::Smooth { average, .. } | CoatAlbedo::Rough { average, .. } => *average,
        }
    }
}

/// The albedo of a coat, which may lie between those of two roughnesses.
#[derive(Clone, Copy, Debug)]
pub struct Coat<'a> {
    smoother: &'a CoatAlbedo,
    rougher: &'a CoatAlbedo,
    /// Of the rougher one.
    share: f64,
}

impl<'a> Coat<'a> {
    /// One of a known roughness.
    pub fn new(albedo: &'a CoatAlbedo) -> Coat<'a> {
        Coat { smoother: albedo, rougher: albedo, share: 0.0 }
    }

    /// That of GGX α among [`CoatAlbedo::of_all_roughnesses`], linear in ⁴√α. As averages are interpolated like what they are averages of, a
    /// base under it loses nothing that the coat does not reflect.
    pub fn of_alpha(albedos: &'a [CoatAlbedo], alpha: f64) -> Coat<'a> {
        let position = alpha.clamp(0.0, 1.0).sqrt().sqrt() * (albedos.len() - 1) as f64;
        let cell = (position as usize).min(albedos.len() - 2);
        Coat { smoother: &albedos[cell], rougher: &albedos[cell + 1], share: position - cell as f64 }
    }

    /// E(μ).
    pub fn at(&self, cosine: f64) -> f64 {
        self.between(|albedo| albedo.at(cosine))
    }

    /// 2∫E(μ)μ dμ.
    pub fn average(&self) -> f64 {
        self.between(CoatAlbedo::average)
    }

    /// Whether there is none to be seen.
    pub fn is_none(&self) -> bool {
        *self.rougher == CoatAlbedo::None
    }

    fn between(&self, of: impl Fn(&CoatAlbedo) -> f64) -> f64 {
        let low = of(self.smoother);
        if self.share == 0.0 { low } else { low + (of(self.rougher) - low) * self.share }
    }
}

/// E(μ) = ∫ F·G2/G1 over the visible normals, by quadrature over the two numbers that sample one: midpoints in φ,
/// where the integrand is even and periodic, and midpoints in t with u = sin²(πt/2), which takes the square roots
/// out of both ends.
fn albedo(ggx: Ggx, ior: f64, cosine: f64, [rings, azimuths]: [u32; 2]) -> f64 {
    let wo = DVec3::new((1.0 - cosine * cosine).sqrt(), 0.0, cosine);
    let mut sum = 0.0;
    for ring in 0..rings {
        let angle = FRAC_PI_2 * (f64::from(ring) + 0.5) / f64::from(rings);
        let weight = FRAC_PI_2 * (2.0 * angle).sin() / f64::from(rings);
        for azimuth in 0..azimuths {
            let phi = 0.5 * (f64::from(azimuth) + 0.5) / f64::from(azimuths);
            let m = ggx.sample_visible_normal(wo, [angle.sin().powi(2), phi]);
            let wi = reflect(wo, m);
            if wi.z > 0.0 {
                sum += weight * fresnel_dielectric(wo.dot(m), ior) * unshadowed(ggx, wo, wi);
            }
        }
    }
    sum / f64::from(azimuths)
}

/// G2/G1, in a form that holds for wo.z = 0 as well.
fn unshadowed(ggx: Ggx, wo: DVec3, wi: DVec3) -> f64 {
    let length = |w: DVec3| (ggx.alpha * w.truncate()).extend(w.z).length();
    wi.z * (wo.z + length(wo)) / (wo.z * length(wi) + wi.z * length(wo))
}

/// 2∫E(μ)μ dμ of the tabulated function, exactly: with μ = t⁴, 8∫E(t)t⁷ dt over linear pieces.
fn average(table: &[f32]) -> f64 {
    let step = 1.0 / (table.len() - 1) as f64;
    let piece = |(i, pair): (usize, &[f32])| {
        let (start, end) = (i as f64 * step, (i + 1) as f64 * step);
        let slope = (f64::from(pair[1]) - f64::from(pair[0])) / step;
        let antiderivative = |t: f64| (f64::from(pair[0]) - slope * start) * t.powi(8) + slope * t.powi(9) * 8.0 / 9.0;
        antiderivative(end) - antiderivative(start)
    };
    table.windows(2).enumerate().map(piece).sum()
}
