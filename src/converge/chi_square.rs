//! Pearson's χ² test: do counts follow the expected frequencies?

/// Cells that expect less than this are pooled: below it the statistic does not follow its distribution.
const LEAST_EXPECTED: f64 = 5.0;

/// The outcome of a test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChiSquare {
    /// Σ (observed − expected)² / expected.
    pub statistic: f64,
    /// Cells after pooling, less one.
    pub degrees_of_freedom: usize,
    /// The probability of a statistic at least this large if the expectation is right.
    pub p_value: f64,
}

/// Compares counts with their expectations, cell by cell; both add up to the number of samples. Cells with small
/// expectations are pooled, the smallest first. With fewer than two cells left there is nothing to tell: p = 1.
pub fn chi_square_test(observed: &[u64], expected: &[f64]) -> ChiSquare {
    let mut cells: Vec<(f64, u64)> = expected.iter().copied().zip(observed.iter().copied()).collect();
    cells.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut pooled: Vec<(f64, u64)> = Vec::new();
    for (expected, observed) in cells {
        match pooled.last_mut() {
            Some(pool) if pool.0 < LEAST_EXPECTED => *pool = (pool.0 + expected, pool.1 + observed),
            _ => pooled.push((expected, observed)),
        }
    }
    let statistic = pooled.iter().map(|&(expected, observed)| (observed as f64 - expected).powi(2) / expected).sum();
    let degrees_of_freedom = pooled.len().saturating_sub(1);
    ChiSquare { statistic, degrees_of_freedom, p_value: chi_square_survival(statistic, degrees_of_freedom) }
}

/// The probability that a χ²-distributed number exceeds `statistic`.
pub fn chi_square_survival(statistic: f64, degrees_of_freedom: usize) -> f64 {
    if degrees_of_freedom == 0 {
        return 1.0;
    }
    upper_gamma(degrees_of_freedom as f64 / 2.0, statistic / 2.0)
}

/// The regularised upper incomplete gamma function Q(a, x) = Γ(a, x) / Γ(a), for a > 0: the series below a + 1, Legendre's
/// continued fraction by Lentz's method above. Press et al., *Numerical Recipes*, 3rd edition, §6.2.
fn upper_gamma(a: f64, x: f64) -> f64 {
    const MOST_TERMS: u32 = 100_000;
    if x.is_nan() {
        return f64::NAN;
    }
    if x <= 0.0 {
        return 1.0;
    }
    let front = (a * x.ln() - x - ln_gamma(a)).exp();
    if x < a + 1.0 {
        let (mut term, mut sum) = (1.0 / a, 1.0 / a);
        for n in 1..MOST_TERMS {
            term *= x / (a + f64::from(n));
            sum += term;
            if term < sum * f64::EPSILON {
                break;
            }
        }
        return (1.0 - sum * front).clamp(0.0, 1.0);
    }
    const TINY: f64 = 1e-300;
    let mut b = x + 1.0 - a;
    let mut c = 1.0 / TINY;
    let mut d = 1.0 / b;
    let mut fraction = d;
    for n in 1..MOST_TERMS {
        let n = f64::from(n);
        let coefficient = -n * (n - a);
        b += 2.0;
        d = coefficient * d + b;
        d = 1.0 / if d.abs() < TINY { TINY } else { d };
        c = b + coefficient / c;
        c = if c.abs() < TINY { TINY } else { c };
        fraction *= d * c;
        if (d * c - 1.0).abs() < f64::EPSILON {
            break;
        }
    }
    (fraction * front).clamp(0.0, 1.0)
}

/// ln Γ(x) for x > 0: Lanczos' approximation with g = 7 and nine terms, to about 15 digits.
pub(super) fn ln_gamma(x: f64) -> f64 {
    const COEFFICIENTS: [f64; 9] = [
        0.999_999_999_999_809_9,
        676.520_368_121_885_1,
        -1_259.139_216_722_402_8,
        771.323_428_777_653_1,
        -176.615_029_162_140_6,
        12.507_343_278_686_905,
        -0.138_571_095_265_720_12,
        9.984_369_578_019_572e-6,
        1.505_632_735_149_311_6e-7,
    ];
    let x = x - 1.0;
    let series: f64 = COEFFICIENTS[1..].iter().zip(1..).map(|(c, i)| c / (x + f64::from(i))).sum();
    let t = x + 7.5;
    0.5 * std::f64::consts::TAU.ln() + (x + 0.5) * t.ln() - t + (COEFFICIENTS[0] + series).ln()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn survival_has_the_tabulated_values() {
        // Critical values of the χ² distribution, NIST/SEMATECH e-Handbook of Statistical Methods, §1.3.6.7.4.
        for (statistic, degrees_of_freedom, p) in
            [(3.841, 1, 0.05), (18.307, 10, 0.05), (135.807, 100, 0.01), (0.004, 1, 0.95), (67.328, 100, 0.995)]
        {
            let found = chi_square_survival(statistic, degrees_of_freedom);
            assert!((found - p).abs() < 1e-3, "{statistic}, {degrees_of_freedom}: {found}, not {p}");
        }
        assert!((ln_gamma(0.5) - std::f64::consts::PI.sqrt().ln()).abs() < 1e-14);
        assert!((ln_gamma(11.0) - 3_628_800f64.ln()).abs() < 1e-12);
    }

    #[test]
    fn small_cells_are_pooled_and_wrong_counts_found() {
        let fair = chi_square_test(&[98, 102, 1, 2, 3], &[100.0, 100.0, 2.0, 2.0, 2.0]);
        assert_eq!(fair.degrees_of_freedom, 2);
        assert!(fair.p_value > 0.5);
        assert!(chi_square_test(&[150, 50], &[100.0, 100.0]).p_value < 1e-10);
    }
}
