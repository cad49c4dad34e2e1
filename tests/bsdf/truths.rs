//! Measured, layered and woven surfaces to test with.

use std::sync::Arc;

use glam::{DVec3, Vec2, Vec3};
use neubrdf::scene::{Brdf, Color, Fresnel, LayerBase, Layered, Surface, Woven, Yarn};

use crate::common::tables::{self, metal};
use crate::configurations::Configuration;
use crate::sphere::Random;

/// Tables and samples of metals, with their names.
pub fn measured() -> Vec<(String, Arc<Brdf>)> {
    let phi = |reduction: u32| {
        let steps = 16 / reduction;
        (0..=steps).map(|i| std::f32::consts::PI * (i as f32 / 8.0 - 1.0)).collect::<Vec<f32>>()
    };
    let mut random = Random(1);
    let mut above = || {
        let w = random.direction();
        DVec3::new(w.x, w.y, w.z.abs().max(0.01)).normalize()
    };
    let pairs: Vec<_> = (0..50).map(|_| (above(), above())).collect();
    let samples = |metal, is_isotropic| Brdf::Sparse(tables::sparse(metal, is_isotropic, pairs.iter().copied()));
    let brdfs = [
        ("MERL, α 0.3", Brdf::Merl(tables::merl(&metal(0.3, 0.3)))),
        ("MERL, α 0.05", Brdf::Merl(tables::merl(&metal(0.05, 0.05)))),
        ("RGL, α 0.3", Brdf::Rgl(tables::rgl(&metal(0.3, 0.3), vec![0.0], 16))),
        ("RGL, α 0.2 × 0.4", Brdf::Rgl(tables::rgl(&metal(0.2, 0.4), phi(1), 16))),
        ("RGL, half", Brdf::Rgl(tables::rgl(&metal(0.2, 0.4), phi(2), 16))),
        ("RGL, quarter", Brdf::Rgl(tables::rgl(&metal(0.4, 0.2), phi(4), 16))),
        ("samples, α 0.4", samples(&metal(0.4, 0.4), true)),
        ("samples, α 0.3 × 0.6", samples(&metal(0.3, 0.6), false)),
    ];
    brdfs.map(|(name, brdf)| (name.to_owned(), Arc::new(brdf))).into()
}

/// A coat over white or coloured paint.
pub fn varnish(ior: f32, alpha: f32, albedo: Vec3, absorption: Vec3) -> Surface {
    Surface::Layered(Layered { ior, alpha, absorption, base: LayerBase::Diffuse { albedo } })
}

/// A coat over a metal.
pub fn lacquer(ior: f32, alpha: f32, f0: Vec3, base_alpha: [f32; 2], absorption: Vec3) -> Surface {
    let fresnel = Fresnel::Schlick { f0: Color::constant(f0) };
    let base = LayerBase::Conductor { fresnel, alpha: Vec2::from_array(base_alpha) };
    Surface::Layered(Layered { ior, alpha, absorption, base })
}

pub fn layered() -> Vec<Surface> {
    let paint = Vec3::new(0.8, 0.5, 0.2);
    let gold = Fresnel::Complex { eta: Vec3::new(0.18, 0.54, 1.33), kappa: Vec3::new(3.44, 2.23, 1.88) };
    let base = LayerBase::Conductor { fresnel: gold, alpha: Vec2::splat(0.3) };
    vec![
        varnish(1.5, 0.1, paint, Vec3::ZERO),
        varnish(1.3, 0.4, paint, Vec3::new(0.1, 0.5, 1.0)),
        lacquer(1.5, 0.1, paint, [0.2, 0.2], Vec3::new(0.2, 0.4, 0.8)),
        lacquer(1.5, 0.2, paint, [0.1, 0.5], Vec3::ZERO),
        Surface::Layered(Layered { ior: 1.8, alpha: 0.3, absorption: Vec3::splat(0.2), base }),
    ]
}

pub fn yarn(coverage: f32, gloss: f32, widths: [f32; 2]) -> Yarn {
    Yarn {
        coverage,
        gloss,
        f0: Vec3::new(0.9, 0.6, 0.3),
        albedo: Vec3::new(0.2, 0.4, 0.8),
        specular_width: widths[0],
        volume_width: widths[1],
        isotropy: 0.3,
    }
}

pub fn woven() -> Vec<Surface> {
    let cloth = |warp, weft| Surface::Woven(Woven { warp, weft });
    vec![
        cloth(yarn(0.5, 0.5, [0.1, 0.3]), yarn(0.5, 0.5, [0.1, 0.3])),
        cloth(yarn(0.7, 0.8, [0.03, 0.2]), yarn(0.2, 0.3, [0.2, 0.5])),
        cloth(yarn(1.0, 1.0, [0.02, 0.02]), yarn(0.0, 0.0, [1.0, 1.0])),
        cloth(yarn(0.3, 0.0, [1.0, 1.0]), yarn(0.3, 0.2, [0.5, 0.1])),
    ]
}

/// Some of each kind, seen from somewhere.
pub fn configurations() -> Vec<Configuration> {
    let (brdfs, layers, cloths) = (measured(), layered(), woven());
    vec![
        Configuration::measured(&brdfs[1], 60.0, -70.0),
        Configuration::measured(&brdfs[3], 45.0, 120.0),
        Configuration::measured(&brdfs[6], 30.0, 10.0),
        Configuration::new(layers[2].clone(), 0.0, 0.0),
        Configuration::new(layers[3].clone(), 88.0, 45.0),
        Configuration::new(cloths[0].clone(), 60.0, -70.0),
        Configuration::new(cloths[1].clone(), 80.0, 200.0),
    ]
}
