//! The surfaces and directions that are tested.

use std::sync::Arc;

use glam::{DVec3, Vec2, Vec3};
use neubrdf::material::{self, Bsdf, Prepared};
use neubrdf::scene::{Brdf, Color, Fresnel, Surface};

/// A surface seen from one direction.
pub struct Configuration {
    pub name: String,
    pub surface: Surface,
    pub brdfs: Vec<Arc<Brdf>>,
    pub prepared: Prepared,
    pub wo: DVec3,
}

impl Configuration {
    pub fn new(surface: Surface, theta: f64, phi: f64) -> Configuration {
        let name = format!("{} at {theta}°, {phi}°", describe(&surface));
        let prepared = Prepared::new(&surface, &[]);
        Configuration { name, surface, brdfs: Vec::new(), prepared, wo: direction(theta, phi) }
    }

    /// A BRDF that a file gives.
    pub fn measured((name, brdf): &(String, Arc<Brdf>), theta: f64, phi: f64) -> Configuration {
        let surface = Surface::Measured { brdf: 0 };
        let brdfs = vec![brdf.clone()];
        let prepared = Prepared::new(&surface, &brdfs);
        let name = format!("{name} at {theta}°, {phi}°");
        Configuration { name, surface, brdfs, prepared, wo: direction(theta, phi) }
    }

    pub fn bsdf(&self) -> Bsdf<'_> {
        Bsdf::new(&self.prepared, material::color(&self.surface).value.as_dvec3())
    }
}

pub fn describe(surface: &Surface) -> String {
    match surface {
        Surface::Diffuse { .. } => "diffuse".into(),
        Surface::Conductor { alpha, .. } => format!("conductor α {}×{}", alpha.x, alpha.y),
        Surface::Dielectric { ior, alpha } => format!("dielectric η {ior} α {alpha}"),
        Surface::Coated { ior, alpha, .. } => format!("coated η {ior} α {alpha}"),
        Surface::Measured { brdf } => format!("BRDF {brdf}"),
    }
}

/// The unit vector at these angles, in degrees.
pub fn direction(theta: f64, phi: f64) -> DVec3 {
    let ((sine, cosine), phi) = (theta.to_radians().sin_cos(), phi.to_radians());
    DVec3::new(sine * phi.cos(), sine * phi.sin(), cosine)
}

pub fn diffuse() -> Surface {
    Surface::Diffuse { albedo: Color::constant(Vec3::new(0.8, 0.5, 0.2)) }
}

/// Gold, as its complex index of refraction at 630, 532 and 465 nm (Johnson and Christy 1972).
pub fn gold(alpha_x: f32, alpha_y: f32) -> Surface {
    let fresnel = Fresnel::Complex { eta: Vec3::new(0.18, 0.54, 1.33), kappa: Vec3::new(3.44, 2.23, 1.88) };
    Surface::Conductor { fresnel, alpha: Vec2::new(alpha_x, alpha_y) }
}

pub fn schlick(f0: Vec3, alpha_x: f32, alpha_y: f32) -> Surface {
    Surface::Conductor { fresnel: Fresnel::Schlick { f0: Color::constant(f0) }, alpha: Vec2::new(alpha_x, alpha_y) }
}

pub fn glass(ior: f32, alpha: f32) -> Surface {
    Surface::Dielectric { ior, alpha }
}

pub fn coated(albedo: Vec3, ior: f32, alpha: f32) -> Surface {
    Surface::Coated { albedo: Color::constant(albedo), ior, alpha }
}

/// Everything that is sampled for the χ² tests.
pub fn all() -> Vec<Configuration> {
    let paint = Vec3::new(0.8, 0.5, 0.2);
    let tinted = Vec3::new(0.9, 0.6, 0.3);
    let cases = [
        (diffuse(), 0.0, 0.0),
        (diffuse(), 60.0, 30.0),
        (diffuse(), 89.9, 200.0),
        (gold(0.0, 0.0), 30.0, 0.0),
        (gold(1e-3, 1e-3), 0.0, 0.0),
        (gold(1e-3, 1e-3), 45.0, 10.0),
        (gold(1e-3, 1e-3), 89.0, 100.0),
        (gold(0.01, 0.01), 60.0, -60.0),
        (gold(0.05, 0.05), 85.0, 0.0),
        (gold(0.2, 0.2), 20.0, 0.0),
        (gold(0.2, 0.2), 89.9, 45.0),
        (gold(0.5, 0.5), 75.0, 170.0),
        (gold(1.0, 1.0), 0.0, 0.0),
        (gold(1.0, 1.0), 70.0, 0.0),
        (gold(1.0, 1.0), 89.9, 0.0),
        (schlick(tinted, 0.05, 0.3), 45.0, 30.0),
        (schlick(tinted, 1e-3, 0.5), 60.0, 70.0),
        (schlick(tinted, 0.9, 0.1), 85.0, 20.0),
        (schlick(tinted, 0.3, 0.01), 40.0, 120.0),
        (glass(1.5, 0.0), 50.0, 0.0),
        (glass(1.5, 0.0), 130.0, 0.0),
        (glass(1.5, 1e-3), 0.0, 0.0),
        (glass(1.5, 1e-3), 45.0, 30.0),
        (glass(1.5, 1e-3), 150.0, 30.0),
        (glass(1.5, 0.01), 89.0, 0.0),
        (glass(1.5, 0.1), 60.0, 80.0),
        (glass(1.5, 0.1), 139.0, 80.0),
        (glass(1.5, 0.3), 100.0, -20.0),
        (glass(1.5, 0.6), 30.0, 0.0),
        (glass(1.5, 0.6), 160.0, 0.0),
        (glass(1.5, 1.0), 80.0, 0.0),
        (glass(1.5, 1.0), 95.0, 0.0),
        (glass(1.01, 0.2), 40.0, 0.0),
        (glass(2.4, 0.05), 20.0, 190.0),
        (glass(2.4, 0.3), 170.0, 0.0),
        (glass(0.7, 1e-3), 20.0, 0.0),
        (glass(0.7, 0.1), 45.0, 0.0),
        (glass(0.7, 0.5), 70.0, 40.0),
        (glass(0.7, 0.2), 120.0, 40.0),
        (glass(10.0, 0.2), 60.0, 0.0),
        (coated(paint, 1.5, 0.0), 0.0, 0.0),
        (coated(paint, 1.5, 0.0), 80.0, 0.0),
        (coated(paint, 1.5, 1e-3), 40.0, 0.0),
        (coated(paint, 1.5, 1e-3), 89.0, 0.0),
        (coated(paint, 1.5, 0.05), 70.0, 60.0),
        (coated(paint, 1.5, 0.2), 20.0, 0.0),
        (coated(paint, 2.5, 0.5), 85.0, 0.0),
        (coated(paint, 1.1, 1.0), 50.0, 0.0),
        (coated(Vec3::ZERO, 1.5, 0.3), 30.0, 0.0),
        (coated(Vec3::ONE, 10.0, 0.3), 60.0, 0.0),
        (coated(paint, 1.0, 0.3), 60.0, 0.0),
    ];
    cases.map(|(surface, theta, phi)| Configuration::new(surface, theta, phi)).into()
}
