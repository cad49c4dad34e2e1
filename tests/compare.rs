//! The metrics have their formulas' values; the z-test finds a bias of one per cent and blames nobody without one.

use neubrdf::converge::{
    Comparison, Error, Metrics, ZTest, ZTestOptions, difference, prove_equal, write_difference_png, write_evidence,
};
use neubrdf::image::{Picture, Samples, plane};

fn flat(width: u32, height: u32, color: [f32; 3]) -> Picture {
    let mut picture = Picture::new(width, height);
    picture.set_rgb(plane::BEAUTY, &vec![color; picture.pixels()]);
    picture
}

/// SplitMix64, uniform in (0, 1).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64 + f64::EPSILON
    }
}

/// One sample in fifty sees the lamp: as without light sampling.
const RARE: Distribution = |random| if random.next() < 0.02 { 50.0 } else { 0.0 };

/// What a sample of a pixel is drawn from.
type Distribution = fn(&mut Random) -> f64;

/// Exponential, like the radiance of a diffuse room.
const EXPONENTIAL: Distribution = |random| -random.next().ln();

/// One path in two hundred is forty times as bright as the others: fireflies, unseen by most pixels.
const FIREFLIES: Distribution = |random| if random.next() < 0.005 { 40.0 * random.next() } else { random.next() };

/// A noisy rendering as any renderer here makes it: mean, variance of the mean, sample count.
fn noisy(seed: u64, side: u32, spp: u32, scale: f64, distribution: Distribution) -> Picture {
    let mut random = Random(seed.wrapping_mul(0x1234_5678_9abc_def1));
    let mut picture = Picture::new(side, side);
    let (mut means, mut variances) = (Vec::new(), Vec::new());
    for _ in 0..picture.pixels() {
        let (mut mean, mut variance) = ([0.0; 3], [0.0; 3]);
        for channel in 0..3 {
            let samples: Vec<f64> = (0..spp).map(|_| scale * distribution(&mut random)).collect();
            let average = samples.iter().sum::<f64>() / f64::from(spp);
            let squares: f64 = samples.iter().map(|sample| (sample - average).powi(2)).sum();
            mean[channel] = average as f32;
            variance[channel] = (squares / f64::from((spp - 1).max(1)) / f64::from(spp)) as f32;
        }
        means.push(mean);
        variances.push(variance);
    }
    picture.set_rgb(plane::BEAUTY, &means);
    picture.set_rgb(plane::VARIANCE, &variances);
    picture.set(plane::SAMPLES, Samples::U32(vec![spp; picture.pixels()]));
    picture
}

#[test]
fn metrics_of_flat_pictures_are_their_formulas() {
    let metrics = Metrics::of(&flat(8, 8, [0.6, 0.5, 0.5]), &flat(8, 8, [0.5; 3]), 0.0).unwrap();
    let close = |found: f64, expected: f64| assert!((found / expected - 1.0).abs() < 1e-5, "{found} {expected}");
    close(metrics.mse, 0.01 / 3.0);
    close(metrics.rel_mse, 0.01 / 0.26 / 3.0);
    close(metrics.max_difference, 0.1);
    close(metrics.mean_difference, 0.1 / 3.0);
    close(metrics.bias[0], 0.1);
    assert_eq!(metrics.bias[1], 0.0);
    close(metrics.relative_bias, 0.1 / 1.5);
    assert!(metrics.flip > 0.01 && metrics.flip < 1.0);
}

#[test]
fn equal_pictures_have_no_error() {
    let picture = noisy(1, 16, 4, 1.0, EXPONENTIAL);
    let comparison = Comparison::of(&picture, &picture, 0.0).unwrap();
    assert_eq!(comparison.metrics.mse, 0.0);
    assert_eq!(comparison.metrics.relative_bias, 0.0);
    assert!(comparison.metrics.flip < 1e-6);
    assert_eq!(comparison.z_test.unwrap().p, 1.0);
    let black = flat(4, 4, [0.0; 3]);
    assert_eq!(Metrics::of(&black, &black, 0.0).unwrap().relative_bias, 0.0);
}

#[test]
fn a_nan_is_counted_and_rejected() {
    let reference = noisy(1, 16, 16, 1.0, EXPONENTIAL);
    let mut damaged = noisy(2, 16, 16, 1.0, EXPONENTIAL);
    let mut beauty = damaged.rgb(plane::BEAUTY).unwrap();
    beauty[37][1] = f32::NAN;
    damaged.set_rgb(plane::BEAUTY, &beauty);
    let comparison = Comparison::of(&damaged, &reference, 0.0).unwrap();
    assert_eq!(comparison.metrics.non_finite_pixels, 1);
    assert!(comparison.metrics.mse.is_nan() && comparison.metrics.max_difference.is_nan());
    assert!(comparison.z_test.as_ref().unwrap().rejects(1e-9));
    assert!(comparison.to_json()["metrics"]["mse"].is_null());
}

#[test]
fn pictures_that_cannot_be_compared_say_why() {
    let options = ZTestOptions::default();
    let wrong_size = Comparison::of(&flat(3, 4, [0.0; 3]), &flat(4, 4, [0.0; 3]), 0.0).unwrap_err();
    assert!(wrong_size.to_string().contains("3×4"), "{wrong_size}");
    assert!(matches!(
        Metrics::of(&Picture::new(0, 0), &Picture::new(0, 0), 0.0),
        Err(Error::MissingPlane { .. } | Error::Empty)
    ));
    let no_beauty = Metrics::of(&flat(1, 1, [0.0; 3]), &Picture::new(1, 1), 0.0).unwrap_err();
    assert!(no_beauty.to_string().contains("reference has no channels R, G, B"), "{no_beauty}");
    let no_variance = ZTest::of(&flat(1, 1, [0.0; 3]), &flat(1, 1, [0.0; 3]), options).unwrap_err();
    assert!(no_variance.to_string().contains("variance.R"), "{no_variance}");
    let single = noisy(1, 4, 1, 1.0, EXPONENTIAL);
    assert!(matches!(ZTest::of(&single, &single, options), Err(Error::TooFewSamples { .. })));
    let untested = Comparison::of(&single, &single, 0.0).unwrap();
    assert!(untested.z_test.is_none() && untested.metrics.mse == 0.0 && untested.to_string().contains("two samples"));
}

/// p < 5 % should happen in at most 5 % of equal pairs; what is found may exceed that by the noise of 200 trials.
#[test]
fn equal_distributions_are_not_rejected() {
    for (name, distribution) in [("exponential", EXPONENTIAL), ("fireflies", FIREFLIES)] {
        for (image_spp, reference_spp) in [(16, 16), (64, 64), (16, 256)] {
            let trials = 200;
            let rejected = (0..trials)
                .filter(|trial| {
                    let image = noisy(2 * trial + 1, 32, image_spp, 1.0, distribution);
                    let reference = noisy(2 * trial + 2, 32, reference_spp, 1.0, distribution);
                    ZTest::of(&image, &reference, ZTestOptions::default()).unwrap().rejects(0.05)
                })
                .count();
            println!("{name}, {image_spp} against {reference_spp} spp: {rejected} of {trials} rejected at 5 %");
            assert!(rejected <= 20, "{name} {image_spp} {reference_spp}: {rejected}");
        }
    }
}

/// Where contributions are rare, blocks of four pixels are too small to be normal, and those that `for_noise` picks are not; a picture of
/// little noise keeps its small blocks.
#[test]
fn blocks_grow_until_rare_contributions_are_normal() {
    let trials = 100;
    let mut rejected = [0, 0];
    for trial in 0..trials {
        let image = noisy(2 * trial + 1, 32, 4, 1.0, RARE);
        let reference = noisy(2 * trial + 2, 32, 256, 1.0, EXPONENTIAL);
        let options = ZTestOptions::for_noise(&image, &reference).unwrap();
        assert!(options.block > 4, "{options:?}");
        for (rejected, options) in rejected.iter_mut().zip([ZTestOptions::default(), options]) {
            *rejected += usize::from(ZTest::of(&image, &reference, options).unwrap().rejects(0.01));
        }
    }
    let comparison = Comparison::of(&noisy(1, 32, 4, 1.0, RARE), &noisy(2, 32, 256, 1.0, EXPONENTIAL), 0.0).unwrap();
    assert!(comparison.z_test.unwrap().block > 4);
    println!("rare contributions at 1 %: {rejected:?} of {trials} rejected with small and with grown blocks");
    assert!(rejected[0] > 20 && rejected[1] <= 5, "{rejected:?}");
    let calm = [noisy(1, 32, 64, 1.0, EXPONENTIAL), noisy(2, 32, 64, 1.0, EXPONENTIAL)];
    assert_eq!(ZTestOptions::for_noise(&calm[0], &calm[1]).unwrap(), ZTestOptions::default());
}

#[test]
fn one_per_cent_of_bias_is_found() {
    let reference = noisy(1, 64, 256, 1.0, EXPONENTIAL);
    let biased = noisy(2, 64, 256, 1.01, EXPONENTIAL);
    let test = ZTest::of(&biased, &reference, ZTestOptions::default()).unwrap();
    println!("1 % bias: p = {:.1e}, z of the mean {:?}", test.p, test.z_mean);
    assert!(test.rejects(1e-3));
}

#[test]
fn a_small_wrong_patch_is_found_where_it_is() {
    let reference = noisy(1, 64, 64, 1.0, EXPONENTIAL);
    let mut wrong = noisy(2, 64, 64, 1.0, EXPONENTIAL);
    let mut beauty = wrong.rgb(plane::BEAUTY).unwrap();
    for y in 40..44 {
        for x in 20..24 {
            beauty[y * 64 + x][2] *= 1.5;
        }
    }
    wrong.set_rgb(plane::BEAUTY, &beauty);
    let test = ZTest::of(&wrong, &reference, ZTestOptions::default()).unwrap();
    assert!(test.rejects(1e-6));
    assert_eq!((test.worst_pixel, test.worst_channel), ([20, 40], 2));
    let p = test.p_values(64, 64);
    assert!(p.f32("p.B").unwrap()[43 * 64 + 23] < 1e-6);
}

#[test]
fn pixels_without_variance_must_agree_as_floats_do() {
    let with_noise = |color| {
        let mut picture = flat(8, 8, color);
        picture.set_rgb(plane::VARIANCE, &[[0.0; 3]; 64]);
        picture.set(plane::SAMPLES, Samples::U32(vec![64; 64]));
        picture
    };
    let test = |a, b| ZTest::of(&with_noise(a), &with_noise(b), ZTestOptions::default()).unwrap();
    assert!(!test([1.0; 3], [1.000_002; 3]).rejects(0.01));
    assert!(test([1.0; 3], [1.001; 3]).rejects(0.01));
    assert!(!test([0.0; 3], [0.0; 3]).rejects(0.01));
}

#[test]
fn a_disagreement_leaves_its_evidence() {
    let reference = noisy(1, 16, 64, 1.0, EXPONENTIAL);
    assert!(prove_equal("compare-equal", &noisy(2, 16, 64, 1.0, EXPONENTIAL), &reference, 1e-3).is_ok());
    let wrong = noisy(2, 16, 64, 1.2, EXPONENTIAL);
    let Err(Error::Different { evidence, .. }) = prove_equal("compare-different", &wrong, &reference, 1e-3) else {
        panic!("20 % is found");
    };
    for file in ["image.exr", "reference.exr", "difference.exr", "difference.png", "p-values.exr", "report.txt"] {
        assert!(evidence.join(file).is_file(), "{file}");
    }
    std::fs::remove_dir_all(evidence).unwrap();
}

#[test]
fn a_comparison_reads_as_text_json_and_pictures() {
    let (a, b) = (noisy(1, 16, 16, 1.0, EXPONENTIAL), noisy(2, 16, 16, 1.0, EXPONENTIAL));
    let comparison = Comparison::of(&a, &b, 0.0).unwrap();
    let text = comparison.to_string();
    assert!(["MSE", "relMSE", "FLIP", "z-test"].iter().all(|word| text.contains(word)), "{text}");
    let json = comparison.to_json();
    assert_eq!(json["metrics"]["rel_mse"].as_f64(), Some(comparison.metrics.rel_mse));
    assert!(json["z_test"]["p"].is_number());
    let signed = difference(&a, &b).unwrap().rgb(plane::BEAUTY).unwrap();
    assert_eq!(signed[5][1], a.rgb(plane::BEAUTY).unwrap()[5][1] - b.rgb(plane::BEAUTY).unwrap()[5][1]);
    let directory = tempfile::tempdir().unwrap();
    write_difference_png(directory.path().join("difference.png"), &a, &b, 0.5).unwrap();
    assert_eq!(image::open(directory.path().join("difference.png")).unwrap().width(), 16);
    let evidence = write_evidence("compare-written", &a, &b, &comparison).unwrap();
    std::fs::remove_dir_all(evidence).unwrap();
}
