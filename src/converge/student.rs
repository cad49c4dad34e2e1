//! Student's t distribution.

use super::chi_square::ln_gamma;

/// t such that a t-distributed number of `degrees_of_freedom` (> 0, need not be whole) lies within ±t with probability
/// `confidence` in (0, 1); to about 10⁻⁹ relative. ∞ where there are no degrees of freedom.
pub fn student_t(confidence: f64, degrees_of_freedom: f64) -> f64 {
    if degrees_of_freedom.is_nan() || degrees_of_freedom <= 0.0 {
        return f64::INFINITY;
    }
    let beyond = 1.0 - confidence;
    let (mut low, mut high) = (0.0, 1.0);
    while two_sided_t(high, degrees_of_freedom) > beyond && high < 1e12 {
        (low, high) = (high, high * 2.0);
    }
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if two_sided_t(middle, degrees_of_freedom) > beyond { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// The probability that a t-distributed number is at least as far from 0 as `t`: I_x(ν/2, ½) with x = ν/(ν + t²).
pub fn two_sided_t(t: f64, degrees_of_freedom: f64) -> f64 {
    match t.is_nan() {
        true => 0.0,
        false => incomplete_beta(degrees_of_freedom / 2.0, 0.5, degrees_of_freedom / (degrees_of_freedom + t * t)),
    }
}

/// The regularised incomplete beta function I_x(a, b) by Lentz's continued fraction. Press et al., *Numerical Recipes*, 3rd
/// edition, §6.4.
fn incomplete_beta(a: f64, b: f64, x: f64) -> f64 {
    if x <= 0.0 || x >= 1.0 {
        return x.clamp(0.0, 1.0);
    }
    // Where the fraction converges slowly, the other tail's converges fast.
    if x > (a + 1.0) / (a + b + 2.0) {
        return 1.0 - incomplete_beta(b, a, 1.0 - x);
    }
    const TINY: f64 = 1e-300;
    let guard = |value: f64| if value.abs() < TINY { TINY } else { value };
    let front = (ln_gamma(a + b) - ln_gamma(a) - ln_gamma(b) + a * x.ln() + b * (-x).ln_1p()).exp() / a;
    let mut c = 1.0;
    let mut d = 1.0 / guard(1.0 - (a + b) * x / (a + 1.0));
    let mut fraction = d;
    for m in 1..10_000 {
        let m = f64::from(m);
        for coefficient in [
            m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m)),
            -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0)),
        ] {
            d = 1.0 / guard(1.0 + coefficient * d);
            c = guard(1.0 + coefficient / c);
            fraction *= d * c;
        }
        if (d * c - 1.0).abs() < f64::EPSILON {
            break;
        }
    }
    (front * fraction).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// NIST/SEMATECH e-Handbook of Statistical Methods, §1.3.6.7.2.
    #[test]
    fn quantiles_have_the_tabulated_values() {
        for (confidence, degrees_of_freedom, t) in
            [(0.95, 1.0, 12.706), (0.95, 3.0, 3.182), (0.95, 10.0, 2.228), (0.99, 5.0, 4.032), (0.95, 1e6, 1.960)]
        {
            let found = student_t(confidence, degrees_of_freedom);
            assert!((found - t).abs() <= 5.1e-4, "{confidence} {degrees_of_freedom}: {found}, not {t}");
        }
        assert_eq!(student_t(0.95, 0.0), f64::INFINITY);
    }
}
