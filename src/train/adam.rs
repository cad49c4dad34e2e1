//! Adam (Kingma and Ba, ICLR 2015), and how the learning rate falls.

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
            for (((parameter, gradient), first), second) in
                parameters.iter_mut().zip(gradient).zip(first).zip(second)
            {
                *first += (1.0 - BETA_1) * (gradient - *first);
                *second += (1.0 - BETA_2) * (gradient * gradient - *second);
                *parameter -= rate * *first / ((*second * correction).sqrt() + EPSILON);
            }
        });
    }
}
