//! Adam (Kingma and Ba, ICLR 2015).

use pulp::Arch;

const BETA_1: f32 = 0.9;
const BETA_2: f32 = 0.99;
const EPSILON: f32 = 1e-10;

/// Running moments of the gradient of some parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Adam {
    /// Mean of the gradient.
    pub first: Vec<f32>,
    /// Mean of its square.
    pub second: Vec<f32>,
}

impl Adam {
    /// Of `count` parameters that have not moved yet.
    pub fn new(count: usize) -> Adam {
        Adam { first: vec![0.0; count], second: vec![0.0; count] }
    }

    /// Moves the parameters from `start` on by one step of length `rate`; `step` counts from 1.
    pub fn step(&mut self, start: usize, parameters: &mut [f32], gradient: &[f32], rate: f32, step: u32) {
        let count = gradient.len();
        let parameters = &mut parameters[start..start + count];
        let (first, second) = (&mut self.first[start..start + count], &mut self.second[start..start + count]);
        let power = |beta: f32| 1.0 - f64::from(beta).powi(step.min(100_000) as i32) as f32;
        let (rate, correction) = (rate / power(BETA_1), 1.0 / power(BETA_2));
        Arch::new().dispatch(|| {
            for (((parameter, gradient), first), second) in parameters.iter_mut().zip(gradient).zip(first).zip(second) {
                *first += (1.0 - BETA_1) * (gradient - *first);
                *second += (1.0 - BETA_2) * (gradient * gradient - *second);
                *parameter -= rate * *first / ((*second * correction).sqrt() + EPSILON);
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_those_of_the_paper() {
        let gradients = [0.3, -0.2, 0.05, 1.0];
        let (mut parameter, mut m, mut v) = (1.0f64, 0.0, 0.0);
        let (mut found, mut adam) = (vec![0.0, 1.0], Adam::new(2));
        for (index, gradient) in gradients.into_iter().enumerate() {
            let step = index as i32 + 1;
            let [beta_1, beta_2] = [BETA_1, BETA_2].map(f64::from);
            m = beta_1 * m + (1.0 - beta_1) * gradient;
            v = beta_2 * v + (1.0 - beta_2) * gradient * gradient;
            parameter -= 0.01 * (m / (1.0 - beta_1.powi(step))) / ((v / (1.0 - beta_2.powi(step))).sqrt() + 1e-10);
            adam.step(1, &mut found, &[gradient as f32], 0.01, step as u32);
            assert!((f64::from(found[1]) - parameter).abs() < 1e-6);
        }
        assert_eq!(found[0], 0.0);
    }
}
