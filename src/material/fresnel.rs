//! Fresnel reflectance of smooth boundaries for unpolarised light.
//!
//! Source: Born and Wolf, *Principles of Optics*, §1.5; in the form of Pharr, Jakob and Humphreys, *Physically Based
//! Rendering*, 4th edition, §9.3.5 and §9.3.6.

use std::ops::{Add, Div, Mul, Sub};

use glam::DVec3;

/// Reflectance between two dielectrics, seen from the first at |cos θ| = `cosine`; `eta` is the index of the second
/// over that of the first. 1 where reflection is total.
pub fn fresnel_dielectric(cosine: f64, eta: f64) -> f64 {
    let cosine = cosine.clamp(0.0, 1.0);
    let sine_squared_t = (1.0 - cosine * cosine) / (eta * eta);
    if sine_squared_t >= 1.0 {
        return 1.0;
    }
    let cosine_t = (1.0 - sine_squared_t).sqrt();
    let parallel = (eta * cosine - cosine_t) / (eta * cosine + cosine_t);
    let perpendicular = (cosine - eta * cosine_t) / (cosine + eta * cosine_t);
    (parallel * parallel + perpendicular * perpendicular) / 2.0
}

/// 2∫F(μ)μ dμ for `eta` ≥ 1: the share of diffuse light that the boundary reflects. Walsh 1926, after Duntley 1942,
/// as in d'Eon and Irving, *A Quantized-Diffusion Model*, SIGGRAPH 2011, appendix A.
pub fn fresnel_dielectric_average(eta: f64) -> f64 {
    if eta - 1.0 < 1e-3 {
        // The closed form cancels here. F = F₀ + … of first order in |η − 1| comes from grazing angles only.
        return average_by_quadrature(eta);
    }
    let (e2, e4) = (eta.powi(2), eta.powi(4));
    0.5 + (eta - 1.0) * (3.0 * eta + 1.0) / (6.0 * (eta + 1.0).powi(2))
        + e2 * (e2 - 1.0).powi(2) / (e2 + 1.0).powi(3) * ((eta - 1.0) / (eta + 1.0)).ln()
        - 2.0 * eta.powi(3) * (e2 + 2.0 * eta - 1.0) / ((e2 + 1.0) * (e4 - 1.0))
        + 8.0 * e4 * (e4 + 1.0) / ((e2 + 1.0) * (e4 - 1.0).powi(2)) * eta.ln()
}

/// The same by the midpoint rule in μ = t³, which gives grazing angles the most points.
fn average_by_quadrature(eta: f64) -> f64 {
    const STEPS: u32 = 4096;
    let step = 1.0 / f64::from(STEPS);
    let integrand = |t: f64| 2.0 * fresnel_dielectric(t.powi(3), eta) * t.powi(3) * 3.0 * t * t;
    (0..STEPS).map(|i| integrand((f64::from(i) + 0.5) * step) * step).sum()
}

/// Reflectance of a metal of index η + iκ against vacuum, per channel.
pub fn fresnel_complex(cosine: f64, eta: DVec3, kappa: DVec3) -> DVec3 {
    let channel = |eta, kappa| {
        let index = Complex(eta, kappa);
        let cosine = cosine.clamp(0.0, 1.0);
        let sine_squared_t = Complex(1.0 - cosine * cosine, 0.0) / (index * index);
        let cosine_t = (Complex(1.0, 0.0) - sine_squared_t).sqrt();
        let cosine = Complex(cosine, 0.0);
        let parallel = ratio(index * cosine - cosine_t, index * cosine + cosine_t);
        let perpendicular = ratio(cosine - index * cosine_t, cosine + index * cosine_t);
        (parallel + perpendicular) / 2.0
    };
    DVec3::new(channel(eta.x, kappa.x), channel(eta.y, kappa.y), channel(eta.z, kappa.z))
}

/// Schlick's approximation, *An Inexpensive BRDF Model for Physically-Based Rendering*, 1994, from the reflectance at
/// normal incidence.
pub fn fresnel_schlick(cosine: f64, f0: DVec3) -> DVec3 {
    f0 + (1.0 - f0) * (1.0 - cosine.clamp(0.0, 1.0)).powi(5)
}

/// |a / b|², where both vanish 1: the limit at grazing incidence.
fn ratio(a: Complex, b: Complex) -> f64 {
    if b.norm() > 0.0 { (a.norm() / b.norm()).min(1.0) } else { 1.0 }
}

/// A complex number: real and imaginary part.
#[derive(Clone, Copy)]
struct Complex(f64, f64);

impl Complex {
    /// |z|².
    fn norm(self) -> f64 {
        self.0 * self.0 + self.1 * self.1
    }

    /// The square root with a real part ≥ 0.
    fn sqrt(self) -> Complex {
        let length = self.norm().sqrt();
        let real = ((length + self.0).max(0.0) / 2.0).sqrt();
        let imaginary = ((length - self.0).max(0.0) / 2.0).sqrt();
        Complex(real, imaginary.copysign(self.1))
    }
}

impl Add for Complex {
    type Output = Complex;
    fn add(self, other: Complex) -> Complex {
        Complex(self.0 + other.0, self.1 + other.1)
    }
}

impl Sub for Complex {
    type Output = Complex;
    fn sub(self, other: Complex) -> Complex {
        Complex(self.0 - other.0, self.1 - other.1)
    }
}

impl Mul for Complex {
    type Output = Complex;
    fn mul(self, other: Complex) -> Complex {
        Complex(self.0 * other.0 - self.1 * other.1, self.0 * other.1 + self.1 * other.0)
    }
}

impl Div for Complex {
    type Output = Complex;
    fn div(self, other: Complex) -> Complex {
        let product = self * Complex(other.0, -other.1);
        Complex(product.0 / other.norm(), product.1 / other.norm())
    }
}
