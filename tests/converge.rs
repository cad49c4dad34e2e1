//! A study's statistics are right: slopes, intervals, floors, ratios and tests do what they claim, at their rate; and a study that is
//! interrupted, resumed, judged and compared says the same as one that is not.

use neubrdf::converge::study::{
    AboutTruth, Analysis, Clock, Environment, Gate, Gram, MethodRecord, MethodResult, Products, Question, Record, Run,
    SceneRecord, change_lines, compare, summary_text, write_report,
};
use neubrdf::converge::{CONFIDENCE, Timing};

/// SplitMix64.
struct Random(u64);

impl Random {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64 + f64::EPSILON
    }

    /// Box and Muller 1958.
    fn normal(&mut self) -> f64 {
        (-2.0 * self.uniform().ln()).sqrt() * (std::f64::consts::TAU * self.uniform()).cos()
    }
}

/// A renderer that never was.
#[derive(Clone, Copy)]
struct Made {
    /// Noise is `noise`·spp^`slope`, as a variance.
    noise: f64,
    slope: f64,
    /// Model error of every pixel.
    bias: f64,
    /// Seconds a sample, give or take 2 %.
    seconds: f64,
    /// Variance of the reference's pixels.
    reference: f64,
}

const MADE: Made = Made { noise: 1.0, slope: -1.0, bias: 0.0, seconds: 0.1, reference: 0.0 };
const LADDER: [u32; 4] = [4, 16, 64, 256];

/// What a study would have measured of it: 128 pixels × channels, R repetitions. MSE and relMSE are alike.
fn method(name: &str, made: Made, repetitions: u32, reference: &[f64], random: &mut Random) -> MethodRecord {
    let mut runs = Vec::new();
    let mut products = Vec::new();
    for spp in LADDER {
        let deviation = (made.noise * f64::from(spp).powf(made.slope)).sqrt();
        let differences: Vec<Vec<f64>> = (0..repetitions)
            .map(|_| reference.iter().map(|noise| made.bias + deviation * random.normal() - noise).collect())
            .collect();
        let weights = vec![1.0; reference.len()];
        let gram = Gram::of(&differences, &weights);
        for (repetition, error) in gram.errors().into_iter().enumerate() {
            let seconds = made.seconds * f64::from(spp) * (1.0 + 0.02 * random.normal());
            runs.push(Run {
                spp,
                repetition: repetition as u32,
                seed: 0,
                timing: Timing { seconds, cpu_seconds: seconds, others: 0.0 },
                mse: error,
                rel_mse: error,
                flip: error.sqrt(),
                relative_bias: 0.0,
                non_finite_pixels: 0,
                rejected_samples: 0,
            });
        }
        let variance = made.reference;
        let squares = variance * (4.0 * made.bias.powi(2) + 2.0 * variance) * reference.len() as f64;
        let uncertainty = squares.sqrt() / reference.len() as f64;
        products.push(Products {
            spp,
            mse: gram.clone(),
            rel_mse: gram,
            mse_uncertainty: uncertainty,
            rel_mse_uncertainty: uncertainty,
        });
    }
    MethodRecord {
        name: name.into(),
        label: name.into(),
        model: None,
        unavailable: None,
        preparation: None,
        runs,
        products,
        bias: None,
    }
}

fn record(made: &[(&str, Made)], repetitions: u32, seed: u64) -> Record {
    let mut random = Random(seed.wrapping_mul(0x1234_5678_9abc_def1));
    let variance = made[0].1.reference;
    let reference: Vec<f64> = (0..128).map(|_| variance.sqrt() * random.normal()).collect();
    let mut record = Record::new(
        Environment { started: 0, load: "0".into(), ..Environment::here() },
        Question {
            methods: made.iter().map(|(name, _)| (name.to_string(), name.to_string())).collect(),
            max_depth: 1,
            ladder: LADDER.to_vec(),
            repetitions,
            reference_spp: 1,
            seed: 0,
            targets: vec![2e-2, 1e-4],
            exposure: 0.0,
            clock: Clock::Wall,
        },
    );
    record.scenes.push(SceneRecord {
        name: "made".into(),
        hash: "0".into(),
        models: vec![],
        size: [8, 8],
        truth: AboutTruth {
            origin: "nowhere".into(),
            spp: 1,
            mse: variance,
            rel_mse: variance,
            has_variance: true,
            mean: 1.0,
        },
        methods: made.iter().map(|(name, made)| method(name, *made, repetitions, &reference, &mut random)).collect(),
    });
    record
}

fn analysed(made: Made, repetitions: u32, seed: u64) -> MethodResult {
    Analysis::of(&record(&[("a", made)], repetitions, seed)).scenes.remove(0).methods.remove(0)
}

fn holds(interval: [f64; 2], truth: f64) -> bool {
    interval[0] <= truth && truth <= interval[1]
}

/// 95 % intervals hold the truth in 95 % of trials, give or take the noise of the trials (400 of them: 1.1 %) and 3 % more, as the
/// logarithm of a variance is but nearly normal.
fn assert_covers(what: &str, held: usize, trials: usize) {
    let rate = held as f64 / trials as f64;
    println!("{what}: {:.1} % of {trials} intervals hold the truth", 100.0 * rate);
    assert!((0.91..=0.995).contains(&rate), "{what}: {rate}");
}

#[test]
fn slopes_are_recovered_and_their_intervals_cover() {
    for repetitions in [2, 3, 4, 8] {
        for slope in [-1.0, -1.5] {
            let trials = 400;
            let held = (0..trials).filter(|seed| {
                let found = analysed(Made { slope, ..MADE }, repetitions, *seed as u64).slope.unwrap();
                assert!((found.value - slope).abs() < 0.3, "{found:?}");
                holds(found.interval(CONFIDENCE), slope)
            });
            assert_covers(&format!("slope {slope}, {repetitions} repetitions"), held.count(), trials);
        }
    }
}

#[test]
fn noise_and_efficiency_are_what_they_are_and_their_intervals_cover() {
    let trials = 400;
    let (mut noise, mut efficiency, mut ratio) = (0, 0, 0);
    for seed in 0..trials {
        let slower = Made { seconds: 0.2, ..MADE };
        let analysis = Analysis::of(&record(&[("a", MADE), ("b", slower)], 4, seed as u64));
        let [a, b] = analysis.scenes[0].methods.as_slice() else { panic!("two methods") };
        noise += usize::from(holds(a.top().unwrap().noise.unwrap().interval(CONFIDENCE), 1.0 / 256.0));
        // noise · seconds = 1/256 · 25.6
        efficiency += usize::from(holds(a.efficiency.unwrap().interval(CONFIDENCE), (1.0f64 / 0.1).ln()));
        ratio +=
            usize::from(holds(a.efficiency.unwrap().minus(&b.efficiency.unwrap()).interval(CONFIDENCE), 2f64.ln()));
    }
    assert_covers("noise", noise, trials);
    assert_covers("efficiency", efficiency, trials);
    assert_covers("efficiency ratio", ratio, trials);
}

#[test]
fn a_model_error_is_a_floor_and_noise_is_none() {
    let trials = 400;
    let biased = Made { bias: 0.1, ..MADE };
    let (mut found, mut held, mut wrongly) = (0, 0, 0);
    for seed in 0..trials {
        let method = analysed(biased, 4, seed as u64);
        found += usize::from(method.has_floor);
        held += usize::from(holds(method.floor.unwrap().interval(CONFIDENCE), 0.01));
        wrongly += usize::from(analysed(MADE, 4, seed as u64).has_floor);
    }
    println!("floor found in {found}, wrongly in {wrongly} of {trials}");
    assert!(found >= trials * 95 / 100, "{found}");
    // One-sided at 99 %: half a per cent of trials.
    assert!(wrongly <= trials * 25 / 1000, "{wrongly}");
    assert_covers("floor", held, trials);

    let method = analysed(biased, 8, 1);
    let reached = method.floor_reached.unwrap().value.exp();
    // Noise is 1/spp, seconds 0.1·spp: as low as 0.01 after 10 s.
    assert!((reached / 10.0 - 1.0).abs() < 0.4, "{reached}");
    assert!(!method.targets[0].is_below_floor && method.targets[1].is_below_floor);
    assert!(method.targets[1].seconds.is_none());
    let seconds = method.targets[0].seconds.unwrap().value.exp();
    // 0.02 = 0.01 + 1/100.
    assert!((seconds / 10.0 - 1.0).abs() < 0.4, "{seconds}");
}

/// What the reference's noise adds to every error is taken off, and what that leaves uncertain is in the interval.
#[test]
fn the_noise_of_the_reference_counts_for_nothing() {
    let trials = 400;
    let noisy = Made { reference: 0.01, bias: 0.1, ..MADE };
    let (mut held, mut mean) = (0, 0.0);
    for seed in 0..trials {
        let method = analysed(noisy, 4, seed as u64);
        held += usize::from(holds(method.floor.unwrap().interval(CONFIDENCE), 0.01));
        mean += method.floor.unwrap().value / trials as f64;
    }
    assert!((mean - 0.01).abs() < 4e-4, "{mean}");
    assert_covers("floor under a noisy reference", held, trials);
    let unbiased = Made { reference: 0.01, ..MADE };
    let wrongly = (0..trials).filter(|seed| analysed(unbiased, 4, *seed as u64).has_floor).count();
    assert!(wrongly <= trials * 25 / 1000, "{wrongly}");
    assert!(analysed(unbiased, 4, 1).top().unwrap().reference_dominates);
}

#[test]
fn a_single_render_gives_errors_and_claims_nothing_more() {
    let method = analysed(MADE, 1, 3);
    assert!(method.slope.is_some());
    assert!(method.floor.is_none() && !method.has_floor);
    assert_eq!(method.rungs.len(), LADDER.len());
    assert!(method.top().unwrap().noise.is_none());
    assert!(method.top().unwrap().rel_mse.standard_error.is_infinite());
}

fn gate(text: &str) -> Gate {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("gate.toml");
    std::fs::write(&path, text).unwrap();
    Gate::read(&path).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn thresholds_break_beyond_chance_only() {
    let slower = Made { seconds: 0.2, ..MADE };
    let analysis = Analysis::of(&record(&[("fast", MADE), ("slow", slower)], 6, 5));
    let holds = |text: &str| {
        let verdicts = gate(text).judge(&analysis);
        assert!(!verdicts.is_empty());
        verdicts.iter().all(|verdict| verdict.holds)
    };
    assert!(holds("[[method]]\nslope = [-1.3, -0.7]\nrel_mse = 0.006\nfloor = 0.001\nshown = true"));
    assert!(!holds("[[method]]\nslope = [-2.0, -1.4]"));
    assert!(!holds("[[method]]\nrel_mse = 0.002"));
    assert!(holds("[[ratio]]\nmethod = \"fast\"\nover = \"slow\"\nleast = 1.3\nshown = true"));
    assert!(!holds("[[ratio]]\nmethod = \"fast\"\nover = \"slow\"\nleast = 3"));
    assert!(!holds("[[ratio]]\nmethod = \"slow\"\nover = \"fast\"\nleast = 1"));
    // Two is within chance, but not shown.
    assert!(holds("[[ratio]]\nmethod = \"fast\"\nover = \"slow\"\nleast = 1.99"));
    assert!(!holds("[[ratio]]\nmethod = \"fast\"\nover = \"slow\"\nleast = 1.99\nshown = true"));
    // What nothing answers to is broken, and says so.
    assert!(!holds("[[method]]\nmethod = \"warp\"\nslope = [-2, 0]"));
    assert!(!holds("[[ratio]]\nmethod = \"warp\"\nover = \"slow\"\nleast = 1"));
    assert!(!holds("[[method]]\nbias_p = 0.01"));
    for (text, told) in [
        ("[[method]]\nscene = \"b\"\nmethod = \"fast\"\nslope = [-2, 0]", "there is no scene 'b'"),
        (
            "[[method]]\nscene = \"made\"\nmethod = \"warp\"\nslope = [-2, 0]",
            "made: there are no figures of a method 'warp'",
        ),
        ("[[ratio]]\nscene = \"b\"\nmethod = \"fast\"\nover = \"slow\"\nleast = 1", "there is no scene 'b'"),
    ] {
        assert_eq!(gate(text).judge(&analysis)[0].message, told);
    }
}

#[test]
fn a_mistaken_threshold_file_is_refused_with_its_line() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("gate.toml");
    for (text, told) in [
        ("[[methods]]", "`method`"),
        ("[[method]]\nslop = 1", "`slope`"),
        ("[[ratio]]\nover = \"a\"", "method"),
        ("", "no threshold"),
    ] {
        std::fs::write(&path, text).unwrap();
        let error = Gate::read(&path).unwrap_err().to_string();
        assert!(error.contains(told) && error.contains("gate.toml"), "{text}: {error}");
    }
}

#[test]
fn a_comparison_knows_better_from_worse_and_from_chance() {
    let old = record(&[("a", MADE)], 6, 1);
    let again = record(&[("a", MADE)], 6, 2);
    let faster = record(&[("a", Made { seconds: 0.03, ..MADE })], 6, 3);
    let verdicts = |new: &Record, old: &Record| {
        compare(new, old).changes.iter().map(|change| (change.figure, change.is_better())).collect::<Vec<_>>()
    };
    assert_eq!(verdicts(&again, &old), [("efficiency", None), ("seconds", None), ("noise", None)]);
    assert_eq!(verdicts(&faster, &old), [("efficiency", Some(true)), ("seconds", Some(true)), ("noise", None)]);
    assert_eq!(verdicts(&old, &faster), [("efficiency", Some(false)), ("seconds", Some(false)), ("noise", None)]);
    // That nothing compares is said, too.
    let told = |new: &Record| change_lines(&compare(new, &old));
    let of_another_method = record(&[("b", MADE)], 6, 1);
    assert!(told(&of_another_method).starts_with("not compared: made: no method has figures"));
    let mut elsewhere = old.clone();
    elsewhere.scenes[0].name = "other".into();
    assert_eq!(told(&elsewhere), "not compared: other: the older study has no scene of that name\n");
}

#[test]
fn scenes_that_were_rendered_otherwise_are_not_compared() {
    let old = record(&[("a", MADE)], 6, 1);
    let refused = |reason: &str, change: fn(&mut Record)| {
        let mut new = old.clone();
        change(&mut new);
        let versus = compare(&new, &old);
        assert!(versus.changes.is_empty() && change_lines(&versus).contains(reason), "{versus:?}");
    };
    refused("size is 4×4, was 8×8", |new| new.scenes[0].size = [4, 4]);
    refused("hash is 1, was 0", |new| new.scenes[0].hash = "1".into());
    refused("depth is 2, was 1", |new| new.question.max_depth = 2);
    refused("clock is cpu, was wall", |new| new.question.clock = Clock::Cpu);
}

/// The truth still does, where a model is another.
#[test]
fn a_model_that_was_trained_anew_is_not_compared_with_the_old_one() {
    let mut old = record(&[("truth", MADE), ("fit", MADE)], 6, 1);
    old.scenes[0].methods[1].model = Some("neural".into());
    old.scenes[0].models = vec![("neural".into(), "0".into())];
    let mut new = old.clone();
    let methods = |new: &Record| -> Vec<String> {
        let changes = compare(new, &old).changes;
        changes.into_iter().filter(|change| change.figure == "noise").map(|change| change.method).collect()
    };
    assert_eq!(methods(&new), ["truth", "fit"]);
    new.scenes[0].models[0].1 = "1".into();
    assert_eq!(methods(&new), ["truth"]);
    let told = change_lines(&compare(&new, &old));
    assert!(told.ends_with("not compared: made: fit: its model's hash is 1, was 0\n"), "{told}");
}

#[test]
fn a_report_is_one_page_and_the_same_for_the_same_numbers() {
    let record = record(&[("a < b", MADE), ("c", Made { bias: 0.1, ..MADE })], 4, 1);
    let analysis = Analysis::of(&record);
    let write = || {
        let directory = tempfile::tempdir().unwrap();
        let page = write_report(&record, &analysis, directory.path()).unwrap();
        let read = |name: &str| std::fs::read_to_string(directory.path().join(name)).unwrap();
        (std::fs::read_to_string(page).unwrap(), read("runs.csv"), read("analysis.json"))
    };
    let (page, csv, json) = write();
    assert_eq!((page.clone(), csv.clone(), json), write());
    assert!(page.matches("<svg viewBox").count() == 4 && page.contains("a &lt; b") && !page.contains("a < b"));
    assert!(!page.contains("http") && !page.contains("NaN") && !page.contains("src=\"file"));
    assert_eq!(csv.lines().count(), 1 + 2 * 4 * LADDER.len());
}

/// A method whose device is no longer there when the study goes on.
#[test]
fn what_is_half_done_and_no_longer_available_is_told_once() {
    let mut record = record(&[("a", MADE), ("b", MADE)], 3, 1);
    let [a, b] = record.scenes[0].methods.as_mut_slice() else { panic!("two methods") };
    a.runs.pop();
    b.unavailable = Some("gone".into());
    let analysis = Analysis::of(&record);
    let text = summary_text(&record, &analysis);
    assert!(text.lines().count() == 3 && text.trim_end().ends_with("the rest is not available: gone"), "{text}");
    let directory = tempfile::tempdir().unwrap();
    let page = std::fs::read_to_string(write_report(&record, &analysis, directory.path()).unwrap()).unwrap();
    assert!(page.contains("11 of 12 renders"));
}

#[test]
fn a_record_survives_its_file() {
    let record = record(&[("a", MADE)], 3, 1);
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("study.json");
    record.write(&path).unwrap();
    assert!(Record::read(&path).unwrap() == record, "the records differ");
    let text = std::fs::read_to_string(&path).unwrap();
    for damaged in [&text[..text.len() / 2], &text.replace("\"format\": 1", "\"format\": 99"), "", "[]"] {
        std::fs::write(&path, damaged).unwrap();
        assert!(Record::read(&path).unwrap_err().to_string().contains("study.json"));
    }
}

#[cfg(feature = "embree")]
mod studies {
    use std::path::Path;
    use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

    use neubrdf::converge::study::{Axes, Error, Event, Plan, ScenePlan, run};
    use neubrdf::image::{Metadata, plane, read_exr, write_exr};

    use super::*;

    fn cornell() -> std::path::PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell/scene.toml")
    }

    /// By Embree alone: it needs no Vulkan.
    fn plan(devices: &[&str]) -> Plan {
        let device = devices.iter().map(|device| device.to_string()).collect();
        Plan {
            scenes: vec![ScenePlan::new(cornell())],
            methods: Axes { device, ..Axes::default() }.methods().unwrap(),
            max_depth: 3,
            size: Some([16, 16]),
            ladder: vec![2, 8],
            repetitions: 3,
            reference_spp: 256,
            ..Plan::default()
        }
    }

    /// All but what a clock says.
    fn timeless(mut record: Record) -> Record {
        record.environment.started = 0;
        record.environment.load.clear();
        for method in record.scenes.iter_mut().flat_map(|scene| &mut scene.methods) {
            method.preparation = None;
            for run in &mut method.runs {
                run.timing = Timing { seconds: 0.0, cpu_seconds: 0.0, others: 0.0 };
            }
        }
        record
    }

    #[test]
    fn a_resumed_study_is_the_uninterrupted_one() {
        let directory = tempfile::tempdir().unwrap();
        let (whole, parts, cache) =
            (directory.path().join("whole"), directory.path().join("parts"), directory.path().join("cache"));
        let plan = plan(&["embree"]);
        let never = AtomicBool::new(false);
        let expected = run(&plan, &whole, &cache, false, &|_| {}, &never).unwrap();
        assert_eq!(expected.scenes[0].methods[0].runs.len(), 6);
        // Another program's reference is not taken for this one's.
        let kept = std::fs::read_dir(&cache).unwrap().next().unwrap().unwrap().file_name();
        assert!(kept.to_str().unwrap().ends_with(concat!("-3-256-", env!("NEUBRDF_REFERENCE"), ".exr")), "{kept:?}");
        let bias = expected.scenes[0].methods[0].bias.as_ref().unwrap();
        assert!(bias.p > 1e-3, "{bias:?}");

        // Stopped after each render.
        let mut sessions = 0;
        let resumed = loop {
            let stop = AtomicBool::new(false);
            let renders = AtomicUsize::new(0);
            let observe = |event: Event| {
                if matches!(event, Event::Render { .. }) && renders.fetch_add(1, Ordering::SeqCst) == 1 {
                    stop.store(true, Ordering::SeqCst);
                }
            };
            let record = run(&plan, &parts, &cache, sessions > 0, &observe, &stop).unwrap();
            sessions += 1;
            if record.scenes[0].methods[0].runs.len() == 6 && sessions > 1 {
                break record;
            }
            assert!(sessions < 12);
        };
        assert!(sessions >= 5, "{sessions}");
        let resumed = run(&plan, &parts, &cache, true, &|_| {}, &never).map(timeless).unwrap_or(timeless(resumed));
        assert!(resumed == timeless(expected), "the records differ");
    }

    #[test]
    fn another_study_is_neither_overwritten_nor_resumed() {
        let directory = tempfile::tempdir().unwrap();
        let (output, cache) = (directory.path().join("study"), directory.path().join("cache"));
        let never = AtomicBool::new(false);
        let small = Plan { ladder: vec![1, 2], repetitions: 1, ..plan(&["embree"]) };
        let record = run(&small, &output, &cache, false, &|_| {}, &never).unwrap();
        // A single sample does not know its variance.
        assert_eq!(record.scenes[0].methods[0].bias.as_ref().unwrap().spp, 2);
        assert!(matches!(run(&small, &output, &cache, false, &|_| {}, &never), Err(Error::Occupied { .. })));
        let other = Plan { max_depth: 4, ..small.clone() };
        let error = run(&other, &output, &cache, true, &|_| {}, &never).unwrap_err().to_string();
        assert!(error.contains("depth 3") && error.contains("this study has 4"), "{error}");
        let other = Plan { size: Some([8, 8]), ..small.clone() };
        assert!(run(&other, &output, &cache, true, &|_| {}, &never).unwrap_err().to_string().contains("scenes"));
        let (truth, another) = (output.join("pictures/cornell/reference.exr"), directory.path().join("another.exr"));
        let mut picture = read_exr(truth).unwrap().0;
        let brighter =
            picture.rgb(plane::BEAUTY).unwrap().iter().map(|pixel| pixel.map(|x| x + 1.0)).collect::<Vec<_>>();
        picture.set_rgb(plane::BEAUTY, &brighter);
        write_exr(&another, &picture, &Metadata::default()).unwrap();
        let mut other = small;
        other.scenes[0].reference = Some(another);
        let error = run(&other, &output, &cache, true, &|_| {}, &never).unwrap_err().to_string();
        assert!(error.contains("reference Embree") && error.contains("another.exr"), "{error}");
    }

    /// Nothing has to be rendered again for them.
    #[test]
    fn a_resumed_study_answers_for_other_targets_and_another_clock() {
        let directory = tempfile::tempdir().unwrap();
        let (output, cache) = (directory.path().join("study"), directory.path().join("cache"));
        let never = AtomicBool::new(false);
        let small = Plan { ladder: vec![1], repetitions: 1, ..plan(&["embree"]) };
        let first = run(&small, &output, &cache, false, &|_| {}, &never).unwrap();
        let asked = Plan { targets: vec![0.5], clock: Clock::Cpu, ..small };
        let second = run(&asked, &output, &cache, true, &|_| {}, &never).unwrap();
        assert_eq!((second.question.targets.as_slice(), second.question.clock), (&[0.5][..], Clock::Cpu));
        assert!(second.scenes == first.scenes, "the records differ");
        assert!(Record::read(&output.join("study.json")).unwrap() == second, "the file differs");
    }

    #[test]
    fn what_is_not_available_is_said_and_the_rest_goes_on() {
        let directory = tempfile::tempdir().unwrap();
        let never = AtomicBool::new(false);
        let mut plan = Plan { ladder: vec![1], repetitions: 1, ..plan(&["embree", "no such device"]) };
        let mut lost = plan.methods[0].clone();
        lost.model = Some("neubrdf".into());
        plan.methods.push(lost);
        let warnings = std::sync::Mutex::new(Vec::new());
        let observe = |event: Event| {
            if let Event::Warning(message) = event {
                warnings.lock().unwrap().push(message);
            }
        };
        let (output, cache) = (directory.path().join("study"), directory.path().join("cache"));
        let record = run(&plan, &output, &cache, false, &observe, &never).unwrap();
        let methods = &record.scenes[0].methods;
        assert!(methods[0].unavailable.is_none() && methods[0].runs.len() == 1 && methods[0].bias.is_none());
        assert!(methods[1].unavailable.is_some() && methods[1].runs.is_empty());
        assert!(methods[2].unavailable.as_ref().unwrap().contains("models"));
        assert_eq!(warnings.lock().unwrap().len(), 2);
        let page = write_report(&record, &Analysis::of(&record), &output).unwrap();
        assert!(std::fs::read_to_string(page).unwrap().contains("Not available here"));
        plan.methods.remove(0);
        let none = run(&plan, &directory.path().join("none"), &cache, false, &|_| {}, &never);
        assert!(matches!(none, Err(Error::NothingToRun(_))));
    }

    /// A model of the same scene with another albedo has an error floor, and is no biased estimator of itself.
    #[test]
    fn a_wrong_model_is_told_from_a_biased_estimator() {
        let directory = tempfile::tempdir().unwrap();
        let scene = |albedo: f32| {
            let file = directory.path().join(format!("{albedo}.toml"));
            std::fs::write(
                directory.path().join("floor.obj"),
                "v -1 0 1\nv 1 0 1\nv 1 0 -1\nv -1 0 -1\nusemtl m\nf 1 2 3 4\n",
            )
            .unwrap();
            std::fs::write(
                &file,
                format!(
                    "[camera]\neye = [0, 2, 1]\ntarget = [0, 0, 0]\n[film]\nwidth = 16\nheight = 16\n[[mesh]]\nfile = \"floor.obj\"\n\
                     [material.m]\ntype = \"diffuse\"\nalbedo = {albedo}\n[environment]\nradiance = [1, 0.5, 0.2]\n[sun]\ndirection = [1, 1, 0]\nirradiance = 1\n"
                ),
            )
            .unwrap();
            file
        };
        let mut plan = Plan { repetitions: 5, size: None, ladder: vec![8, 32], ..plan(&["embree"]) };
        plan.scenes = vec![ScenePlan { models: vec![("grey".into(), scene(0.8))], ..ScenePlan::new(scene(0.5)) }];
        plan.scenes[0].name = "floor".into();
        let mut model = plan.methods[0].clone();
        model.model = Some("grey".into());
        plan.methods.push(model);
        let never = AtomicBool::new(false);
        let (output, cache) = (directory.path().join("study"), directory.path().join("cache"));
        let record = run(&plan, &output, &cache, false, &|_| {}, &never).unwrap();
        let analysis = Analysis::of(&record);
        let [truth, grey] = analysis.scenes[0].methods.as_slice() else { panic!("two methods") };
        assert!(!truth.has_floor && grey.has_floor, "{:?} {:?}", truth.floor, grey.floor);
        assert!(truth.bias_p.unwrap() > 0.01 && grey.bias_p.unwrap() > 0.01);
        assert_eq!(grey.label, "embree, grey");
    }
}
