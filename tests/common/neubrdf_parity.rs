//! How far values of a device are from a NeuBRDF's definition.
//!
//! What a network computes is x = ln(1 + gain · f). Values agree when it does to 10⁻⁴: f to a relative 10⁻⁴ where it is not
//! small, and to 10⁻⁴ / gain where it is. Quarters of corners, pixels of different size beside one another, and the horizons of frames make
//! steps, or nearly; next to one the device may be on its other side: there the value has to agree with that of a direction 10⁻⁶ away. Everywhere else
//! the device is not excused from anything.

use glam::{DVec3, Vec3};
use neubrdf::material::turned;
use neubrdf::scene::brdf::{Footprint, NeuBrdf, SphereGrid};

/// How far x may be off.
pub const TOLERANCE: f64 = 1e-4;

/// How far from a step a direction may be taken to be on its other side, and how far rounding moves it: next to the horizon, at cos θ = 10⁻³, what a
/// frame receives changes by 10⁻⁴ over that.
const REACHES: [f64; 2] = [1e-6, 1e-7];

/// Largest deviation of x, where, and how many pairs were next to a step.
#[derive(Clone, Debug, Default)]
pub struct Deviation {
    pub worst: f64,
    pub place: String,
    pub at_steps: usize,
    pub pairs: usize,
}

impl Deviation {
    pub fn merge(self, other: Deviation) -> Deviation {
        let (at_steps, pairs) = (self.at_steps + other.at_steps, self.pairs + other.pairs);
        let worse = if self.worst >= other.worst { self } else { other };
        Deviation { at_steps, pairs, ..worse }
    }
}

pub fn compare(brdf: &NeuBrdf, footprint: Footprint, wo: [f32; 3], wi: [f32; 3], found: [f32; 3]) -> Deviation {
    let encoded = |f: DVec3| (f64::from(brdf.encoding.gain) * f).map(f64::ln_1p);
    let double = |w: [f32; 3]| Vec3::from(w).as_dvec3();
    let found = encoded(double(found));
    let difference = |wo, wi| (encoded(brdf.eval_at(footprint, wo, wi)) - found).abs().max_element();
    let inputs = [wo, wi].map(double);
    let mut deviation = Deviation { worst: difference(inputs[0], inputs[1]), pairs: 1, ..Deviation::default() };
    if deviation.worst > TOLERANCE {
        let places = |w: DVec3| {
            let (x, y) = w.normalize().any_orthonormal_pair();
            let shifts = [
                (0.0, 0.0),
                (1.0, 0.0),
                (-1.0, 0.0),
                (0.0, 1.0),
                (0.0, -1.0),
                (0.7, 0.7),
                (-0.7, 0.7),
                (0.7, -0.7),
                (-0.7, -0.7),
            ];
            let moved = move |reach: f64| shifts.map(|(s, t)| w + reach * (s * x + t * y));
            REACHES.into_iter().flat_map(moved).map(|w| DVec3::new(w.x, w.y, w.z.max(1e-6)))
        };
        // Of isotropic models, steps in what directions are turned to. Of those with frames, at the horizons of these.
        let turns = brdf.is_isotropic_about_z();
        let [wo, wi] = if turns { turned(inputs[0], inputs[1]) } else { inputs };
        let as_turned = NeuBrdf { is_isotropic: brdf.is_isotropic && !turns, ..brdf.clone() };
        let difference = |wo, wi| (encoded(as_turned.eval_at(footprint, wo, wi)) - found).abs().max_element();
        let nearby = places(wo).flat_map(|wo| places(wi).map(move |wi| (wo, wi)));
        deviation.worst = nearby.map(|(wo, wi)| difference(wo, wi)).fold(deviation.worst, f64::min);
        deviation.at_steps = 1;
    }
    deviation.place = format!("{footprint:?} {wo:?} {wi:?}");
    deviation
}

/// Directions at which something special happens.
pub fn hard_directions(n_side: u32) -> Vec<Vec3> {
    let mut found = vec![Vec3::Z];
    let grid = SphereGrid::new(n_side).unwrap();
    let lowest = |w: DVec3| DVec3::new(w.x, w.y, w.z.max(1e-6)).as_vec3();
    // Grid points: pole, borders and corners of faces, equator.
    let step = grid.point_count().div_ceil(300);
    found.extend((0..grid.point_count()).step_by(step).map(|point| lowest(grid.point(point))));
    found.extend((grid.point_count() - 8..grid.point_count()).map(|point| lowest(grid.point(point))));
    for azimuth in 0..16 {
        let (sin, cos) = (f64::from(azimuth) * std::f64::consts::PI / 8.0).sin_cos();
        for z in [1e-6, 1e-3, 0.3, 2.0 / 3.0, 0.9, 1.0 - 1e-6, 1.0 - 1e-12] {
            let rho = f64::sqrt(1.0 - z * z);
            found.push(DVec3::new(rho * cos, rho * sin, z).as_vec3());
        }
    }
    // φ = ±π to the bit, axes, denormals.
    for zero in [0.0, -0.0, 1e-40, -1e-40, 1e-30, -1e-20, 1e-18] {
        let signs = [(-0.6, zero), (0.6, zero), (zero, 0.6), (zero, -0.6)];
        found.extend(signs.map(|(x, y)| Vec3::new(x, y, 0.8)));
        found.push(Vec3::new(zero, zero, 1.0));
        found.push(Vec3::new(zero, -0.5 * zero, 1.0));
    }
    // Not unit vectors, by an ulp.
    let longer: Vec<Vec3> = found.iter().map(|w| w * (1.0 + f32::EPSILON)).collect();
    let shorter: Vec<Vec3> = found.iter().map(|w| w * (1.0 - f32::EPSILON / 2.0)).collect();
    [found, longer, shorter].concat().into_iter().filter(|w| w.z >= 1e-6).collect()
}
