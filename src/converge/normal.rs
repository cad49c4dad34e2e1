//! The normal distribution's tail, and many tests at once.

use std::f64::consts::{FRAC_1_SQRT_2, PI};

/// The probability that a standard normal variable is at least as far from 0 as `z`; accurate to about 10⁻¹³
/// relative down to the smallest doubles. NaN counts as infinitely far.
pub fn two_sided_p(z: f64) -> f64 {
    if z.is_nan() { 0.0 } else { erfc(z.abs() * FRAC_1_SQRT_2) }
}

/// The complementary error function of x ≥ 0 (Abramowitz & Stegun 7.1.6 and 7.1.14).
fn erfc(x: f64) -> f64 {
    if x < 2.5 {
        // erf(x) = 2/√π · e^(−x²) · Σ 2ⁿ x^(2n+1) / (2n+1)!!, all terms positive.
        let mut term = x;
        let mut sum = x;
        for n in 1..80 {
            term *= 2.0 * x * x / f64::from(2 * n + 1);
            sum += term;
        }
        1.0 - 2.0 / PI.sqrt() * (-x * x).exp() * sum
    } else {
        // √π·e^(x²)·erfc(x) = 1/(x + ½/(x + 1/(x + (3/2)/(x + …)))), from the inside out.
        let fraction = (1..80).rev().fold(x, |inner, n| x + f64::from(n) / 2.0 / inner);
        (-x * x).exp() / (PI.sqrt() * fraction)
    }
}

/// The probability that the smallest of `tests` independent p-values is at most `smallest_p` (Šidák 1967); for
/// positively dependent tests it errs towards acceptance.
pub fn sidak(smallest_p: f64, tests: usize) -> f64 {
    -(tests as f64 * (-smallest_p).ln_1p()).exp_m1()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tail_has_its_known_values() {
        for (z, p) in [
            (0.0, 1.0),
            (1.0, 0.317_310_507_862_914),
            (1.959_963_984_540_054, 0.05),
            (3.0, 0.002_699_796_063_260_19),
            (3.6, 3.182_171_803_150_672e-4),
            (5.0, 5.733_031_437_583_88e-7),
            (10.0, 1.523_970_604_832_11e-23),
        ] {
            assert!((two_sided_p(z) / p - 1.0).abs() < 1e-10, "{z}: {} {p}", two_sided_p(z));
            assert_eq!(two_sided_p(z), two_sided_p(-z));
        }
        assert_eq!(two_sided_p(f64::INFINITY), 0.0);
        assert_eq!(two_sided_p(f64::NAN), 0.0);
    }

    #[test]
    fn sidak_is_the_chance_of_the_smallest() {
        assert!((sidak(0.01, 100) - (1.0 - 0.99_f64.powi(100))).abs() < 1e-12);
        assert_eq!(sidak(0.0, 1000), 0.0);
        assert_eq!(sidak(1.0, 3), 1.0);
        assert!((sidak(1e-20, 1000) / 1e-17 - 1.0).abs() < 1e-9);
    }
}
