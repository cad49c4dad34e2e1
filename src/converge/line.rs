//! A straight line through points whose ordinates are uncertain: how error falls on log-log axes.

use serde::{Deserialize, Serialize};

use super::estimate::Estimate;

/// y = `level` + `slope`·(x − `center`), by least squares.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Line {
    /// Its slope.
    pub slope: Estimate,
    /// Its value in the middle of the points.
    pub level: Estimate,
    /// The middle of the points.
    pub center: f64,
}

impl Line {
    /// Through groups of points: abscissa, and ordinates of repetitions. `dependence` ≥ 1 says by how much the variance of a
    /// group's mean exceeds that of independent ordinates of that scatter ([`super::study::Gram::noise_points`]). `None` unless
    /// there are two abscissas and more points than it takes to draw a line.
    pub fn fit(groups: &[(f64, Vec<f64>)], dependence: f64) -> Option<Line> {
        let points = || groups.iter().flat_map(|(x, ordinates)| ordinates.iter().map(|y| (*x, *y)));
        let count = points().count() as f64;
        let center = points().map(|(x, _)| x).sum::<f64>() / count;
        let level = points().map(|(_, y)| y).sum::<f64>() / count;
        let spread: f64 = points().map(|(x, _)| (x - center).powi(2)).sum();
        // Ordinates that depend on each other tell as much as fewer ones would.
        let freedom = count / dependence - 2.0;
        if spread <= 0.0 || freedom <= 0.0 || !level.is_finite() {
            return None;
        }
        let slope = points().map(|(x, y)| (x - center) * (y - level)).sum::<f64>() / spread;
        let squares: f64 = points().map(|(x, y)| (y - level - slope * (x - center)).powi(2)).sum();
        let variance = dependence * squares / (count - 2.0).max(freedom);
        let estimate =
            |value, variance: f64| Estimate { value, standard_error: variance.sqrt(), degrees_of_freedom: freedom };
        Some(Line { slope: estimate(slope, variance / spread), level: estimate(level, variance / count), center })
    }

    /// The line's value.
    pub fn at(&self, x: f64) -> Estimate {
        let distance = x - self.center;
        Estimate {
            value: self.level.value + self.slope.value * distance,
            standard_error: self.level.standard_error.hypot(self.slope.standard_error * distance),
            degrees_of_freedom: self.level.degrees_of_freedom,
        }
    }

    /// Where the line has the value `y`, its error to first order.
    pub fn solve(&self, y: f64) -> Estimate {
        let x = self.center + (y - self.level.value) / self.slope.value;
        Estimate { value: x, standard_error: (self.at(x).standard_error / self.slope.value).abs(), ..self.level }
    }
}
