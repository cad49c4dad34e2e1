//! Numbers with their uncertainty.

use serde::{Deserialize, Serialize};

use super::student::student_t;

/// How sure every interval of a report is.
pub const CONFIDENCE: f64 = 0.95;

/// An estimate of a number.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// The estimate.
    pub value: f64,
    /// Its standard error; ∞ (`null` in JSON) where a single observation does not tell.
    #[serde(deserialize_with = "infinite_if_null")]
    pub standard_error: f64,
    /// Of Student's distribution that the error follows.
    pub degrees_of_freedom: f64,
}

fn infinite_if_null<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    Ok(Option::<f64>::deserialize(deserializer)?.unwrap_or(f64::INFINITY))
}

impl Estimate {
    /// The mean of independent observations; `None` of none.
    pub fn mean(observations: &[f64]) -> Option<Estimate> {
        let count = observations.len() as f64;
        let value = observations.iter().sum::<f64>() / count;
        let squares: f64 = observations.iter().map(|observation| (observation - value).powi(2)).sum();
        let standard_error = if count < 2.0 { f64::INFINITY } else { (squares / (count - 1.0) / count).sqrt() };
        (count >= 1.0).then_some(Estimate { value, standard_error, degrees_of_freedom: count - 1.0 })
    }

    /// By the jackknife (Efron 1982): the estimate from all observations, and the same from all but one of them.
    pub fn jackknife(value: f64, without_one: &[f64]) -> Estimate {
        let count = without_one.len() as f64;
        let mean = without_one.iter().sum::<f64>() / count;
        let squares: f64 = without_one.iter().map(|other| (other - mean).powi(2)).sum();
        let standard_error = if count < 2.0 { f64::INFINITY } else { (squares * (count - 1.0) / count).sqrt() };
        Estimate { value, standard_error, degrees_of_freedom: count - 1.0 }
    }

    /// Half the width of the confidence interval.
    pub fn margin(&self, confidence: f64) -> f64 {
        match self.standard_error == 0.0 {
            true => 0.0,
            false => self.standard_error * student_t(confidence, self.degrees_of_freedom),
        }
    }

    /// The interval that holds the number with probability `confidence`.
    pub fn interval(&self, confidence: f64) -> [f64; 2] {
        let margin = self.margin(confidence);
        [self.value - margin, self.value + margin]
    }

    /// With a further, independent error that is known as if from infinitely many observations.
    pub fn with_error(&self, standard_error: f64) -> Estimate {
        self.plus(&Estimate { value: 0.0, standard_error, degrees_of_freedom: f64::MAX })
    }

    /// The sum with an independent estimate; degrees of freedom by Welch and Satterthwaite.
    pub fn plus(&self, other: &Estimate) -> Estimate {
        let [a, b] = [self, other].map(|estimate| estimate.standard_error.powi(2));
        let freedom = (a + b).powi(2) / (a * a / self.degrees_of_freedom + b * b / other.degrees_of_freedom);
        let least = self.degrees_of_freedom.min(other.degrees_of_freedom);
        Estimate {
            value: self.value + other.value,
            standard_error: (a + b).sqrt(),
            degrees_of_freedom: if freedom.is_finite() { freedom } else { least },
        }
    }

    /// The difference from an independent estimate.
    pub fn minus(&self, other: &Estimate) -> Estimate {
        self.plus(&Estimate { value: -other.value, ..*other })
    }
}
