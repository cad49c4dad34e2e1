//! MERL tables, evaluated: linear between the middles of cells, in the coordinates in which the cells are evenly spaced.
//!
//! Before the first and behind the last middle in θh and θd the table goes on as it ends; in φd it repeats.

use std::f64::consts::{FRAC_1_PI, FRAC_2_PI};

use glam::DVec3;

use crate::scene::{HalfDifference, Merl};

impl Merl {
    /// f(wo, wi), see [`super::Evaluate::eval`].
    pub fn eval(&self, wo: DVec3, wi: DVec3) -> DVec3 {
        let pair = HalfDifference::new(wo, wi);
        let [halves, differences, azimuths] = Merl::SIZE;
        let half = neighbours((pair.theta_half() * FRAC_2_PI).sqrt(), halves);
        let difference = neighbours(pair.theta_difference() * FRAC_2_PI, differences);
        let azimuth = neighbours_around(pair.phi_difference() * FRAC_1_PI, azimuths);
        let mut sum = DVec3::ZERO;
        for (i, weight_i) in half {
            for (j, weight_j) in difference {
                for (k, weight_k) in azimuth {
                    let value = self.values()[(i * differences + j) * azimuths + k];
                    sum += weight_i * weight_j * weight_k * DVec3::from(value.map(f64::from));
                }
            }
        }
        sum
    }
}

/// The two cells of `count` whose middles are next to `position` in [0, 1], with their weights.
fn neighbours(position: f64, count: usize) -> [(usize, f64); 2] {
    let position = (position * count as f64 - 0.5).clamp(0.0, (count - 1) as f64);
    let cell = (position as usize).min(count - 2);
    let fraction = position - cell as f64;
    [(cell, 1.0 - fraction), (cell + 1, fraction)]
}

/// The same where the last cell is next to the first one.
fn neighbours_around(position: f64, count: usize) -> [(usize, f64); 2] {
    let position = position * count as f64 + (count as f64 - 0.5);
    let fraction = position - position.floor();
    [(position as usize % count, 1.0 - fraction), ((position as usize + 1) % count, fraction)]
}
