//! From the numbers of a [`Record`] to the figures of a report. A pure function: the same record gives the same figures.

use serde::Serialize;

use super::gram::Gram;
use super::plan::Clock;
use super::record::{MethodRecord, Products, Record, Run, SceneRecord};
use crate::converge::{CONFIDENCE, Estimate, Line, sidak};

/// All figures of a study.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Analysis {
    /// Scene by scene.
    pub scenes: Vec<SceneResult>,
    /// How many bias tests the study has made: what each is corrected for.
    pub bias_tests: usize,
}

/// A scene's figures.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SceneResult {
    /// Its name.
    pub name: String,
    /// The methods that have rendered it.
    pub methods: Vec<MethodResult>,
}

/// A method's figures in a scene. Logarithms are natural.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MethodResult {
    /// Its full name.
    pub name: String,
    /// Its name in the study.
    pub label: String,
    /// Rung by rung.
    pub rungs: Vec<Rung>,
    /// d ln(noise) / d ln(spp), noise as relMSE: −1 for independent samples.
    pub slope: Option<Estimate>,
    /// The same for MSE.
    pub mse_slope: Option<Estimate>,
    /// ln(relMSE noise) against ln(seconds).
    pub over_time: Option<Line>,
    /// ln(1 / (relMSE noise · seconds)) at the ladder's top.
    pub efficiency: Option<Estimate>,
    /// The same for MSE.
    pub mse_efficiency: Option<Estimate>,
    /// The relMSE that no number of samples gets below: the error of the model.
    pub floor: Option<Estimate>,
    /// Whether that floor is beyond chance, at 99 %.
    pub has_floor: bool,
    /// ln(seconds) at which the noise is as low as the floor.
    pub floor_reached: Option<Estimate>,
    /// For each target of the study, what it takes.
    pub targets: Vec<Target>,
    /// The p-value of its bias test, corrected for all tests of the study.
    pub bias_p: Option<f64>,
}

/// The time to an error.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Target {
    /// relMSE.
    pub rel_mse: f64,
    /// ln(seconds); `None` if the floor is above the target, or nothing can be told.
    pub seconds: Option<Estimate>,
    /// It lies beyond what was rendered.
    pub is_extrapolated: bool,
    /// The floor is above the target.
    pub is_below_floor: bool,
}

/// A method at a number of samples.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Rung {
    /// Samples a pixel.
    pub spp: u32,
    /// Renders.
    pub count: usize,
    /// By the study's clock.
    pub seconds: Estimate,
    /// The reference's noise taken off.
    pub rel_mse: Estimate,
    /// The reference's noise taken off.
    pub mse: Estimate,
    /// What of the relMSE is noise; `None` of a single render.
    pub noise: Option<Estimate>,
    /// What of the MSE is noise.
    pub mse_noise: Option<Estimate>,
    /// Mean ꟻLIP error, the reference's noise within.
    pub flip: Estimate,
    /// More than half of what was measured was noise of the reference.
    pub reference_dominates: bool,
}

/// A floor is told from chance at this confidence.
const FLOOR_CONFIDENCE: f64 = 0.99;

impl Analysis {
    /// Of all that has been rendered.
    pub fn of(record: &Record) -> Analysis {
        let tests = record.scenes.iter().flat_map(|scene| &scene.methods).filter(|method| method.bias.is_some());
        let bias_tests = tests.count();
        let scene = |scene: &SceneRecord| SceneResult {
            name: scene.name.clone(),
            methods: scene
                .methods
                .iter()
                .filter(|method| !method.products.is_empty())
                .map(|method| analyse(record, scene, method, bias_tests))
                .collect(),
        };
        Analysis { scenes: record.scenes.iter().map(scene).collect(), bias_tests }
    }
}

impl MethodResult {
    /// The last rung.
    pub fn top(&self) -> Option<&Rung> {
        self.rungs.last()
    }
}

/// Seconds of a render by a clock. A tick of the processor's is 10 ms, so that less cannot be told.
pub fn seconds(run: &Run, clock: Clock) -> f64 {
    match clock {
        Clock::Wall => run.timing.seconds,
        Clock::Cpu => run.timing.cpu_seconds.max(0.005),
    }
}

fn analyse(record: &Record, scene: &SceneRecord, method: &MethodRecord, bias_tests: usize) -> MethodResult {
    let clock = record.question.clock;
    let rungs: Vec<Rung> = method.products.iter().filter_map(|products| rung(scene, method, products, clock)).collect();
    let log_seconds: Vec<Option<Estimate>> = method
        .products
        .iter()
        .map(|products| {
            Estimate::mean(&times(method, products.spp, clock).into_iter().map(f64::ln).collect::<Vec<_>>())
        })
        .collect();

    let relative = |products: &Products| points(&products.rel_mse, scene.truth.rel_mse);
    let plain = |products: &Products| points(&products.mse, scene.truth.mse);
    let over_samples = |points: &dyn Fn(&Products) -> (Vec<f64>, f64)| {
        fit(method.products.iter().map(|products| (f64::from(products.spp).ln(), points(products))))
    };
    let rel_line = over_samples(&relative);
    let mse_line = over_samples(&plain);
    let over_time = fit(method
        .products
        .iter()
        .zip(&log_seconds)
        .filter_map(|(products, time)| Some((time.as_ref()?.value, relative(products)))));

    let top = method.products.last();
    let log_top = top.map(|products| f64::from(products.spp).ln());
    let top_time = log_seconds.last().copied().flatten();
    let efficiency = |line: &Option<Line>| {
        let cost = line.as_ref()?.at(log_top?).plus(&top_time?);
        Some(Estimate { value: -cost.value, ..cost })
    };
    let floor = top.and_then(|products| products.rel_mse.floor(scene.truth.rel_mse, products.rel_mse_uncertainty));
    let has_floor = floor.is_some_and(|floor| floor.interval(FLOOR_CONFIDENCE)[0] > 0.0);
    let level = if has_floor { floor.map_or(0.0, |floor| floor.value) } else { 0.0 };
    let longest = log_seconds.iter().flatten().map(|time| time.value).fold(f64::NEG_INFINITY, f64::max);
    let target = |rel_mse: &f64| {
        let seconds = over_time
            .filter(|line| line.slope.value < 0.0 && *rel_mse > level)
            .map(|line| line.solve((rel_mse - level).ln()));
        Target {
            rel_mse: *rel_mse,
            seconds,
            is_extrapolated: seconds.is_some_and(|seconds| seconds.value > longest),
            is_below_floor: *rel_mse <= level,
        }
    };
    MethodResult {
        name: method.name.clone(),
        label: method.label.clone(),
        slope: rel_line.map(|line| line.slope),
        mse_slope: mse_line.map(|line| line.slope),
        efficiency: efficiency(&rel_line),
        mse_efficiency: efficiency(&mse_line),
        floor,
        has_floor,
        floor_reached: over_time.filter(|line| has_floor && line.slope.value < 0.0).map(|line| line.solve(level.ln())),
        targets: record.question.targets.iter().map(target).collect(),
        bias_p: method.bias.as_ref().map(|bias| sidak(bias.p, bias_tests)),
        over_time,
        rungs,
    }
}

/// The noise of each render, or of a single one its error; with the factor of [`Gram::noise_points`].
fn points(gram: &Gram, reference_noise: f64) -> (Vec<f64>, f64) {
    match gram.count() {
        1 => (gram.errors().into_iter().map(|error| error - reference_noise).collect(), 1.0),
        _ => gram.noise_points(),
    }
}

/// A line through logarithms; what is not positive has none and is left out.
fn fit(rungs: impl Iterator<Item = (f64, (Vec<f64>, f64))>) -> Option<Line> {
    let mut most_dependent = 1.0f64;
    let groups: Vec<(f64, Vec<f64>)> = rungs
        .map(|(x, (ordinates, dependence))| {
            most_dependent = most_dependent.max(dependence);
            (x, ordinates.into_iter().filter(|y| *y > 0.0).map(f64::ln).collect())
        })
        .collect();
    Line::fit(&groups, most_dependent)
}

fn times(method: &MethodRecord, spp: u32, clock: Clock) -> Vec<f64> {
    method.runs.iter().filter(|run| run.spp == spp).map(|run| seconds(run, clock)).collect()
}

fn rung(scene: &SceneRecord, method: &MethodRecord, products: &Products, clock: Clock) -> Option<Rung> {
    let error = |gram: &Gram, reference_noise: f64, uncertainty| {
        let errors: Vec<f64> = gram.errors().into_iter().map(|error| error - reference_noise).collect();
        Some(Estimate::mean(&errors)?.with_error(uncertainty))
    };
    let flips: Vec<f64> = method
        .runs
        .iter()
        .filter(|run| run.spp == products.spp && run.non_finite_pixels == 0)
        .map(|run| run.flip)
        .collect();
    let rel_mse = error(&products.rel_mse, scene.truth.rel_mse, products.rel_mse_uncertainty)?;
    Some(Rung {
        spp: products.spp,
        count: products.rel_mse.count(),
        seconds: Estimate::mean(&times(method, products.spp, clock))?,
        reference_dominates: scene.truth.rel_mse > rel_mse.value,
        rel_mse,
        mse: error(&products.mse, scene.truth.mse, products.mse_uncertainty)?,
        noise: products.rel_mse.noise(),
        mse_noise: products.mse.noise(),
        flip: Estimate::mean(&flips)?,
    })
}

/// The ratio of two efficiencies that are given as logarithms, with its interval.
pub fn ratio(log_ratio: &Estimate) -> [f64; 3] {
    let [low, high] = log_ratio.interval(CONFIDENCE);
    [log_ratio.value.exp(), low.exp(), high.exp()]
}
