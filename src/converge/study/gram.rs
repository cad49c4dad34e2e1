//! Telling noise from model error, by products of differences.
//!
//! Let x₁ … x_R be independent pictures of one method at one number of samples, r the reference, and
//! G_ij = mean(w (x_i − r)(x_j − r)) over pixels and channels, with w = 1 for MSE and 1/(r² + 0.01) for relMSE. With b the
//! method's bias (its model error), n_i the noise of a picture and ρ the noise of the reference, x_i − r = b + n_i − ρ, hence
//!
//! - E G_ii = mean(w (b² + var n + var ρ)): what an MSE measures;
//! - E G_ij = mean(w (b² + var ρ)) for i ≠ j: the noise of different pictures is independent.
//!
//! So mean(G_ii) − mean(G_ij) estimates the noise without bias and without regard to the reference, and mean(G_ij) less the
//! reference's variance estimates the squared model error, the floor below which no number of samples gets. Both are U-statistics
//! (Hoeffding 1948), no slope has to be assumed, and R = 2 is enough.

use serde::{Deserialize, Serialize};

use crate::converge::Estimate;

/// G, row by row.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Gram {
    /// R rows of R.
    pub products: Vec<Vec<f64>>,
}

impl Gram {
    /// Of differences from the reference, one list of pixels × channels a repetition, under weights.
    pub fn of(differences: &[Vec<f64>], weights: &[f64]) -> Gram {
        let product = |a: &[f64], b: &[f64]| {
            a.iter().zip(b).zip(weights).map(|((a, b), weight)| a * b * weight).sum::<f64>() / weights.len() as f64
        };
        let mut products = vec![vec![0.0; differences.len()]; differences.len()];
        for (i, a) in differences.iter().enumerate() {
            for (j, b) in differences.iter().enumerate().take(i + 1) {
                products[i][j] = product(a, b);
                products[j][i] = products[i][j];
            }
        }
        Gram { products }
    }

    /// How many pictures there are.
    pub fn count(&self) -> usize {
        self.products.len()
    }

    /// The error of each picture, the reference's noise within.
    pub fn errors(&self) -> Vec<f64> {
        (0..self.count()).map(|i| self.products[i][i]).collect()
    }

    /// Mean of G_ij, i ≠ j, of all pictures but one; `None` of fewer than two.
    fn common(&self, left_out: Option<usize>) -> Option<f64> {
        let kept = || (0..self.count()).filter(|i| Some(*i) != left_out);
        let pairs = || kept().flat_map(|i| kept().filter(move |j| *j != i).map(move |j| self.products[i][j]));
        let count = pairs().count();
        (count > 0).then(|| pairs().sum::<f64>() / count as f64)
    }

    /// The noise of each picture, by its distance from the mean of the others:
    /// (R−1)/R · mean(w (x_i − mean of x_j, j ≠ i)²). They average to mean(G_ii) − mean(G_ij). Empty of fewer than two.
    pub fn noise_of(&self) -> Vec<f64> {
        let others = self.count() as f64 - 1.0;
        if others < 1.0 {
            return Vec::new();
        }
        (0..self.count())
            .map(|i| {
                let rest = || (0..self.count()).filter(move |j| *j != i);
                let cross: f64 = rest().map(|j| self.products[i][j]).sum();
                let square: f64 = rest().flat_map(|j| rest().map(move |k| self.products[j][k])).sum();
                others / (others + 1.0)
                    * (self.products[i][i] - 2.0 * cross / others + square / (others * others)).max(0.0)
            })
            .collect()
    }

    /// [`noise_of`](Gram::noise_of) as observations for an average or a line, with the factor by which the variance of their mean
    /// exceeds what their scatter tells if they are taken for independent.
    ///
    /// Each has the others in it, so that for normal noise two of them have the correlation c = 1/(R−1)²: their scatter shows 1 − c
    /// of the variance, and the variance of their mean is 1 + (R−1)·c times that of independent ones; (R−1)/(R−2) in all. Of two pictures
    /// there is one observation.
    pub fn noise_points(&self) -> (Vec<f64>, f64) {
        let mut noise = self.noise_of();
        match noise.len() {
            0..=2 => {
                noise.truncate(1);
                (noise, 1.0)
            }
            count => (noise, (count as f64 - 1.0) / (count as f64 - 2.0)),
        }
    }

    /// The noise at this number of samples.
    pub fn noise(&self) -> Option<Estimate> {
        let (points, dependence) = self.noise_points();
        let mean = Estimate::mean(&points)?;
        Some(Estimate {
            standard_error: mean.standard_error * dependence.sqrt(),
            degrees_of_freedom: (points.len() as f64 - 2.0).max(0.0),
            ..mean
        })
    }

    /// The squared model error: `reference_noise` is what the reference's variance adds, `uncertainty` the standard error of that and of its
    /// product with the difference. `None` of fewer than two pictures; its error is infinite with fewer than three.
    pub fn floor(&self, reference_noise: f64, uncertainty: f64) -> Option<Estimate> {
        let value = self.common(None)? - reference_noise;
        let without_one: Vec<f64> =
            (0..self.count()).filter_map(|left_out| self.common(Some(left_out))).map(|g| g - reference_noise).collect();
        if without_one.len() < 3 {
            return Some(Estimate { value, standard_error: f64::INFINITY, degrees_of_freedom: 1.0 });
        }
        Some(Estimate::jackknife(value, &without_one).with_error(uncertainty))
    }
}
