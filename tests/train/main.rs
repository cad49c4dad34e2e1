//! Training: what it learns, that it does so again, and that it can be stopped.

mod group;
#[path = "../common/maps.rs"]
mod maps;
mod surface;

use std::f64::consts::FRAC_1_PI;

use glam::DVec3;
use neubrdf::material::{Bsdf, Evaluate, Prepared};
use neubrdf::scene::brdf::{Brdf, NeuBrdf, Precision, SurfaceFrame};
use neubrdf::scene::{Color, Fresnel, Surface};
use neubrdf::train::check::check;
use neubrdf::train::measure::{FitErrors, Query, compare, directional_albedo, sample_errors};
use neubrdf::train::{Evaluator, GroundTruth, Model, Pair, Plan, Quality, Recipe, Session};

/// A rough metal over a matte base, isotropic.
fn satin(wo: DVec3, wi: DVec3) -> DVec3 {
    metal(0.3, 0.3).eval(wo, wi) + DVec3::new(0.3, 0.1, 0.05) * FRAC_1_PI
}

struct Metal(Prepared);

impl Metal {
    fn eval(&self, wo: DVec3, wi: DVec3) -> DVec3 {
        Bsdf::new(&self.0, DVec3::new(0.9, 0.7, 0.4)).eval(wo, wi)
    }
}

fn metal(x: f32, y: f32) -> Metal {
    let fresnel = Fresnel::Schlick { f0: Color::constant(glam::Vec3::ONE) };
    Metal(Prepared::new(&Surface::Conductor { fresnel, alpha: glam::Vec2::new(x, y) }, &[]))
}

/// A plan that takes a fraction of a second.
fn small(recipe: Recipe) -> Plan {
    let plan = Plan::new(Model::NeuBrdf, recipe, Quality::Draft, true);
    Plan { n_side: [4; 2], features: 8, hidden: 32, pruned: 32, pairs: 1 << 14, batch: 256, steps: 60, ..plan }
}

fn isotropic(eval: &(dyn Fn(DVec3, DVec3) -> DVec3 + Sync)) -> GroundTruth<'_> {
    GroundTruth::Function { eval, is_isotropic: true }
}

fn finish(session: &mut Session) -> Vec<u8> {
    session.run(u32::MAX);
    session.neubrdf().unwrap().encode(Precision::F32).unwrap()
}

/// The ways of training, each with what happens half-way: codes, pruning.
fn small_plans() -> [Plan; 4] {
    [
        small(Recipe::Default),
        Plan { resolutions: 3, features: 3, codes: [16, 32], ..small(Recipe::Default) },
        Plan { codes: [16, 32], ..small(Recipe::Default) },
        Plan {
            codes: [16; 2],
            hidden: 32,
            pruned: 16,
            n_side: [4; 2],
            features: 8,
            steps: 60,
            batch: 256,
            ..small(Recipe::Paper)
        },
    ]
}

#[test]
fn a_small_fit_is_close() {
    let plan = Plan { n_side: [8; 2], steps: 1500, pairs: 1 << 16, hidden: 32, pruned: 32, ..small(Recipe::Default) };
    let mut session = Session::new(plan, &isotropic(&satin)).unwrap();
    let bytes = finish(&mut session);
    let evaluator = Evaluator::neubrdf(&NeuBrdf::decode(&bytes).unwrap());
    let fit = |pairs: &[[DVec3; 2]]| evaluator.eval(pairs);
    let truth = |pairs: &[[DVec3; 2]]| -> Vec<DVec3> { pairs.iter().map(|[wo, wi]| satin(*wo, *wi)).collect() };
    let errors = compare(32, true, &fit, &truth).errors;
    assert!(errors.pairs.log < 0.02, "mean |Δ ln(1 + f)| {}", errors.pairs.log);
    assert!(errors.ball.ssim > 0.99, "SSIM {}", errors.ball.ssim);
    assert!(errors.worst_albedo < 0.02, "albedo {:?}", errors.albedo);
}

/// The end of a training brings directional albedos nearer to the ground truth's, and costs next to nothing elsewhere. What stops half-way, and the
/// paper's recipe, can be finished as well.
#[test]
fn the_end_closes_gaps_of_albedos() {
    let truth = isotropic(&satin);
    let eval = |pairs: &[[DVec3; 2]]| -> Vec<DVec3> { pairs.iter().map(|[wo, wi]| satin(*wo, *wi)).collect() };
    let plan = Plan { steps: 300, pairs: 1 << 15, ..small(Recipe::Default) };
    let mut session = Session::new(plan, &truth).unwrap();
    session.run(u32::MAX);
    let errors = |brdf: NeuBrdf| {
        let evaluator = Evaluator::neubrdf(&brdf);
        compare(16, true, &|pairs| evaluator.eval(pairs), &eval).errors
    };
    let mut told = vec![];
    let views = session.views(&truth, |done, count| told.push((done, count)));
    let is_progress =
        |pair: &[(usize, usize)]| pair[0].0 < pair[1].0 && pair[1].0 < pair[0].1 && pair[0].1 == pair[1].1;
    assert!(told.len() > 10 && told[0].0 == 0 && told.windows(2).all(is_progress), "{told:?}");
    let [before, after] = [None, views.as_ref()].map(|views| errors(session.finished(views, || ()).unwrap()));
    let mean = |errors: &FitErrors| {
        errors.albedo.iter().map(|albedo| albedo.relative().abs()).sum::<f64>() / errors.albedo.len() as f64
    };
    assert!(mean(&after) < 0.7 * mean(&before), "{} after {}", mean(&after), mean(&before));
    assert!(after.worst_albedo < before.worst_albedo, "{} after {}", after.worst_albedo, before.worst_albedo);
    assert!(after.pairs.log < 1.05 * before.pairs.log, "{} after {}", after.pairs.log, before.pairs.log);

    let paper = Session::new(small(Recipe::Paper), &truth).unwrap();
    assert!(paper.views(&truth, |_, _| ()).is_none() && paper.finished(None, || ()).is_some());
}

#[test]
fn the_fast_evaluation_is_that_of_the_definition() {
    for plan in small_plans() {
        let mut session = Session::new(plan, &isotropic(&satin)).unwrap();
        let brdf = NeuBrdf::decode(&finish(&mut session)).unwrap();
        let pairs: Vec<[DVec3; 2]> = (0..500)
            .map(|i| {
                let at =
                    |k: f64| DVec3::new((k * 1.7).sin(), (k * 0.9).cos(), 1e-3 + (k * 0.37).sin().abs()).normalize();
                [at(f64::from(i)), at(f64::from(i) + 0.5)]
            })
            .collect();
        for (fast, [wo, wi]) in Evaluator::neubrdf(&brdf).eval(&pairs).into_iter().zip(&pairs) {
            let exact = brdf.eval(*wo, *wi);
            assert!((fast - exact).abs().max_element() <= 1e-4 * (exact.max_element() + 0.01), "{fast} {exact}");
        }
    }
}

#[test]
fn a_seed_gives_the_same_bits_whatever_the_threads() {
    for plan in small_plans() {
        let fit = |threads: usize, seed: u64| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let plan = Plan { seed, ..plan.clone() };
            pool.install(|| finish(&mut Session::new(plan, &isotropic(&satin)).unwrap()))
        };
        let first = fit(1, 7);
        assert!(first == fit(3, 7), "{:?}", plan.recipe);
        assert!(first != fit(1, 8), "{:?}", plan.recipe);
    }
}

#[test]
fn a_resumed_training_ends_as_an_uninterrupted_one() {
    let directory = tempfile::tempdir().unwrap();
    for (index, plan) in small_plans().into_iter().enumerate() {
        let whole = finish(&mut Session::new(plan.clone(), &isotropic(&satin)).unwrap());
        // Before and after codes are given and neurons pruned.
        for stop in [13, 50] {
            let path = directory.path().join(format!("{index}-{stop}"));
            let mut session = Session::new(plan.clone(), &isotropic(&satin)).unwrap();
            session.run(stop);
            session.save(&path).unwrap();
            let mut resumed = Session::new(plan.clone(), &isotropic(&satin)).unwrap();
            resumed.restore(&path).unwrap();
            assert_eq!(resumed.seconds(), session.seconds());
            assert!(finish(&mut resumed) == whole, "{:?} from step {stop}", plan.recipe);
            assert!(resumed.seconds() > session.seconds());
        }
    }
}

#[test]
fn a_checkpoint_of_something_else_is_an_error() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("state");
    let mut session = Session::new(small(Recipe::Default), &isotropic(&satin)).unwrap();
    session.run(1);
    session.save(&path).unwrap();
    let restore = |plan: Plan, eval: &(dyn Fn(DVec3, DVec3) -> DVec3 + Sync)| {
        let mut session = Session::new(plan, &isotropic(eval)).unwrap();
        session.restore(&path).map_err(|error| error.to_string())
    };
    assert!(restore(Plan { seed: 1, ..small(Recipe::Default) }, &satin).unwrap_err().contains("the plan"));
    assert!(restore(small(Recipe::Default), &|_, _| DVec3::ONE).unwrap_err().contains("the input"));
    // Values may stay as they are and directions and places not.
    let pair = Pair { wo: glam::Vec3::Z, wi: glam::Vec3::Z, value: glam::Vec3::ONE, ..Pair::default() };
    let [turned, moved] = [Pair { wo: glam::Vec3::new(0.6, 0.0, 0.8), ..pair }, Pair { uv: glam::Vec2::X, ..pair }];
    let session = |pair| {
        let truth = GroundTruth::Samples { pairs: &[pair], is_isotropic: true };
        Session::new(small(Recipe::Default), &truth).unwrap()
    };
    let samples = directory.path().join("samples");
    session(pair).save(&samples).unwrap();
    session(pair).restore(&samples).unwrap();
    for other in [turned, moved] {
        assert!(session(other).restore(&samples).unwrap_err().to_string().contains("the input"));
    }
    let bytes = std::fs::read(&path).unwrap();
    for length in [0, 7, 20, bytes.len() / 2, bytes.len() - 1] {
        std::fs::write(&path, &bytes[..length]).unwrap();
        assert!(restore(small(Recipe::Default), &satin).unwrap_err().contains("is no checkpoint"));
    }
}

#[test]
fn winding_down_ends_soon_and_with_less_error() {
    let plan = Plan { steps: 2000, ..small(Recipe::Default) };
    let mut session = Session::new(plan, &isotropic(&satin)).unwrap();
    session.run(300);
    let before = session.loss();
    session.wind_down();
    finish(&mut session);
    assert_eq!(session.steps(), 400);
    assert!(session.loss() < before, "{} after {before}", session.loss());
}

/// An interrupt that comes that late changes nothing: the file that says so many steps is the one of so many steps.
#[test]
fn winding_down_what_is_almost_done_changes_nothing() {
    for plan in small_plans() {
        let whole = finish(&mut Session::new(plan.clone(), &isotropic(&satin)).unwrap());
        let mut session = Session::new(plan.clone(), &isotropic(&satin)).unwrap();
        session.run(plan.steps - 1);
        session.wind_down();
        assert!(finish(&mut session) == whole, "{:?}", plan.recipe);
    }
}

/// Before neurons are pruned, and after, when the rates have fallen but little.
#[test]
fn winding_down_the_papers_recipe_prunes_and_ends_with_small_steps() {
    for begun in [300, 1450, 1600] {
        let plan = Plan { steps: 2000, codes: [16; 2], pruned: 16, ..small(Recipe::Paper) };
        let mut session = Session::new(plan, &isotropic(&satin)).unwrap();
        session.run(begun);
        session.wind_down();
        let weights = |session: &Session| -> Vec<f32> {
            let layers = session.neubrdf().unwrap().layers;
            assert!(layers.iter().take(3).all(|layer| layer.outputs == 16));
            layers.into_iter().flat_map(|layer| layer.weights).collect()
        };
        session.run(99);
        let before = weights(&session);
        session.run(1);
        let moved = before.iter().zip(weights(&session)).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(session.is_done() && moved < 2e-4, "from step {begun} on: {moved} in the last step");
    }
}

/// Isotropic materials need half of one hemisphere and a line of the other; what is dropped changes nothing that is asked for.
#[test]
fn points_that_no_pair_needs_are_dropped() {
    let mut session = Session::new(Plan { n_side: [16; 2], ..small(Recipe::Default) }, &isotropic(&satin)).unwrap();
    let bytes = finish(&mut session);
    let brdf = NeuBrdf::decode(&bytes).unwrap();
    let kept = |table: &neubrdf::scene::brdf::SphereTable| {
        table.indices.iter().filter(|index| **index != neubrdf::scene::brdf::NO_CODE).count() as f64
            / table.grid.point_count() as f64
    };
    assert!(kept(&brdf.wi) < 0.2, "{} of ωi's points are kept", kept(&brdf.wi));
    assert!((0.4..0.7).contains(&kept(&brdf.wo)), "{} of ωo's points are kept", kept(&brdf.wo));
}

/// From a hundred samples of a matte material, none beyond 73°, what is between and beyond is guessed within a fifth.
#[test]
fn few_samples_are_enough_for_a_simple_material() {
    let pairs: Vec<Pair> = (0..120u32)
        .map(|i| {
            let at = |i: u32| {
                let (theta, phi) = (f64::from(i % 8) * 0.18, f64::from(i) * 2.4);
                DVec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos()).as_vec3()
            };
            Pair { wo: at(i), wi: at(i * 7 + 3), value: glam::Vec3::new(0.2, 0.1, 0.05), ..Pair::default() }
        })
        .collect();
    let plan = Plan { steps: 600, ..small(Recipe::Default).for_samples(pairs.len()) };
    let mut session = Session::new(plan, &GroundTruth::Samples { pairs: &pairs, is_isotropic: true }).unwrap();
    let evaluator = Evaluator::neubrdf(&NeuBrdf::decode(&finish(&mut session)).unwrap());
    let eval = |pairs: &[[DVec3; 2]]| evaluator.eval(pairs);
    let albedo = directional_albedo(DVec3::new(0.6, 0.0, 0.8), 2048, &eval);
    let expected = DVec3::new(0.2, 0.1, 0.05) / FRAC_1_PI;
    assert!(((albedo - expected) / expected).abs().max_element() < 0.2, "{albedo} {expected}");
}

/// A shiny metal seen from up to 70° alone: what is beyond was left to chance, which made more light of it than there was. (A network that sees the half
/// vector knows what lies beyond from what it has seen.)
#[test]
fn what_no_sample_looked_at_sends_no_more_light_than_it_gets() {
    let metal = metal(0.03, 0.03);
    let direction = |theta: f64, phi: f64| DVec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos());
    let angles = (0..6).flat_map(|i| (0..6).flat_map(move |o| (0..7).map(move |phi| [i, o, phi].map(f64::from))));
    let pairs: Vec<Pair> = angles
        .map(|[i, o, phi]| {
            let (wi, wo) = (direction(0.24 * i, 0.0), direction(0.24 * o, 0.5 * phi));
            Pair { wo: wo.as_vec3(), wi: wi.as_vec3(), value: metal.eval(wo, wi).as_vec3(), ..Pair::default() }
        })
        .collect();
    let brightest = |energy: Option<f32>| {
        let plan = Plan { steps: 1500, ..small(Recipe::Default).for_samples(pairs.len()) };
        let plan = Plan { energy: energy.unwrap_or(plan.energy), sees_half_vector: false, ..plan };
        let truth = GroundTruth::Samples { pairs: &pairs, is_isotropic: true };
        let brdf = NeuBrdf::decode(&finish(&mut Session::new(plan, &truth).unwrap())).unwrap();
        let evaluator = Evaluator::neubrdf(&brdf);
        let albedo = |theta| directional_albedo(direction(theta, 0.0), 2048, &|pairs| evaluator.eval(pairs));
        (0..30).map(|i| albedo(0.05 * f64::from(i)).max_element()).fold(0.0, f64::max)
    };
    let (held, free) = (brightest(None), brightest(Some(0.0)));
    assert!(held < 1.05 && free > 1.1, "the largest albedo is {held}, and {free} where it is not looked at");
}

#[test]
fn an_anisotropic_nbrdf_and_a_neubrdf_learn_the_same_metal() {
    let metal = metal(0.15, 0.4);
    let eval = |wo: DVec3, wi: DVec3| metal.eval(wo, wi);
    for (model, most) in [(Model::NeuBrdf, 0.08), (Model::Nbrdf, 0.15)] {
        let plan = Plan { model, n_side: [8; 2], steps: 1200, pairs: 1 << 16, ..small(Recipe::Default) };
        let mut session = Session::new(plan, &GroundTruth::Function { eval: &eval, is_isotropic: false }).unwrap();
        session.run(u32::MAX);
        let evaluator = session.evaluator();
        let truth = |pairs: &[[DVec3; 2]]| -> Vec<DVec3> { pairs.iter().map(|[wo, wi]| eval(*wo, *wi)).collect() };
        let errors = compare(16, false, &|pairs| evaluator.eval(pairs), &truth).errors;
        assert!(errors.pairs.log < most, "{model:?}: mean |Δ ln(1 + f)| {}", errors.pairs.log);
    }
}

#[test]
fn a_trained_nbrdf_is_read_back_as_what_was_trained() {
    let plan = Plan { model: Model::Nbrdf, ..small(Recipe::Default) };
    let mut session = Session::new(plan, &isotropic(&satin)).unwrap();
    session.run(60);
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("satin.safetensors");
    std::fs::write(&path, session.nbrdf().unwrap().to_safetensors("satin")).unwrap();
    let brdf = Brdf::load(&path, Some("satin")).unwrap();
    for (wo, wi) in [(0.1, 0.2), (0.7, 0.3), (1.4, 1.2)].map(|(o, i): (f64, f64)| {
        (DVec3::new(o.sin(), 0.0, o.cos()), DVec3::new(i.sin() * 0.6, i.sin() * 0.8, i.cos()))
    }) {
        let (read, trained) = (brdf.eval(wo, wi), session.evaluator().eval(&[[wo, wi]])[0]);
        assert!((read - trained).abs().max_element() < 1e-4 * (1.0 + trained.max_element()), "{read} {trained}");
    }
}

/// Measurements are what a fit to them is away from, and nothing else.
#[test]
fn residuals_are_those_at_measurements() {
    let at = |i: usize| DVec3::new(0.01 * i as f64, 0.3, 0.8).normalize();
    let value = |wo: DVec3, wi: DVec3| DVec3::splat(1.0 + wo.x * wi.z);
    let pair = |(wo, wi): (DVec3, DVec3)| Pair {
        wo: wo.as_vec3(),
        wi: wi.as_vec3(),
        value: value(wo, wi).as_vec3(),
        ..Pair::default()
    };
    let samples: Vec<Pair> = (0..60).map(|i| pair((at(i), at(70 - i)))).collect();
    let errors = |factor: f64| {
        let fit = |queries: &[Query]| -> Vec<DVec3> {
            queries.iter().map(|query| factor * (value(query.wo, query.wi) + 1.0) - 1.0).collect()
        };
        sample_errors(samples.iter(), &fit)
    };
    assert!(errors(1.0).log < 1e-6 && errors(1.0).relative_rmse < 1e-6);
    assert!((errors(1.1).log - 1.1f64.ln()).abs() < 1e-6);
}

/// What is off by next to nothing is not off by many times what is there.
#[test]
fn errors_of_a_black_material_are_no_nonsense() {
    let of = |value: f64| move |pairs: &[[DVec3; 2]]| vec![DVec3::splat(value); pairs.len()];
    let errors = compare(16, true, &of(1e-7), &of(0.0)).errors;
    assert!(errors.worst_albedo > 0.0 && errors.worst_albedo < 1.0, "{}", errors.worst_albedo);
    assert!(errors.pairs.relative_rmse > 0.0 && errors.pairs.relative_rmse < 1.0, "{}", errors.pairs.relative_rmse);
}

#[test]
fn a_check_finds_what_is_wrong() {
    let matte = |pairs: &[[DVec3; 2]]| vec![DVec3::splat(0.5 * FRAC_1_PI); pairs.len()];
    let good = check(true, SurfaceFrame::OWN, &matte);
    assert_eq!((good.non_finite, good.negative), (0, 0));
    assert!(good.reciprocity_error < 1e-12 && (good.max_albedo - 0.5).abs() < 0.01, "{good:?}");
    let lopsided = |pairs: &[[DVec3; 2]]| pairs.iter().map(|[wo, _]| DVec3::splat(wo.z)).collect::<Vec<_>>();
    let bad = check(true, SurfaceFrame::OWN, &lopsided);
    assert!(bad.reciprocity_error > 0.1 && bad.max_albedo > 3.0, "{bad:?}");
    let broken =
        |pairs: &[[DVec3; 2]]| pairs.iter().map(|[wo, wi]| DVec3::splat((wi.z - wo.z).ln())).collect::<Vec<_>>();
    assert!(check(true, SurfaceFrame::OWN, &broken).non_finite > 0);
    // Of what is not isotropic, from all around and on either side of each view.
    let of = |value: fn(DVec3, DVec3) -> f64| {
        let eval = move |pairs: &[[DVec3; 2]]| pairs.iter().map(|[wo, wi]| DVec3::splat(value(*wo, *wi))).collect();
        check(false, SurfaceFrame::OWN, &eval)
    };
    assert!(of(|wo, _| 0.1 * (1.0 - wo.y)).max_albedo_at[1] > 180.0);
    assert!(of(|wo, _| 0.9 + wo.y).negative > 0 && of(|wo, wi| 0.9 + wo.cross(wi).z).negative > 0);
    // As bright from everywhere, about a normal that leans.
    let frame = SurfaceFrame { normal: DVec3::new(0.36, 0.48, 0.8), ..SurfaceFrame::OWN };
    let received = |[wo, wi]: &[DVec3; 2]| frame.turned(*wo, *wi).map_or(0.0, |(_, received)| received);
    let leaning = |pairs: &[[DVec3; 2]]| pairs.iter().map(|pair| DVec3::splat(received(pair))).collect::<Vec<_>>();
    assert!(check(false, frame, &leaning).reciprocity_error < 1e-12);
    assert!(check(false, SurfaceFrame::OWN, &leaning).reciprocity_error > 0.1);
}

#[test]
fn what_cannot_be_trained_is_an_error() {
    let error = |plan: Plan| Session::new(plan, &isotropic(&satin)).map(|_| ()).unwrap_err().to_string();
    assert!(error(Plan { n_side: [16, 256], ..small(Recipe::Default) }).contains("--n-side"));
    assert!(error(Plan { resolutions: 4, ..small(Recipe::Default) }).contains("--resolutions"));
    assert!(error(Plan { n_side: [16; 2], resolutions: 5, ..small(Recipe::Default) }).contains("--resolutions"));
    assert!(error(Plan { resolutions: 3, features: 22, ..small(Recipe::Default) }).contains("--features"));
    assert!(error(Plan { features: 33, ..small(Recipe::Default) }).contains("--features"));
    assert!(error(Plan { hidden: 129, ..small(Recipe::Default) }).contains("--hidden"));
    assert!(error(Plan { batch: 100, ..small(Recipe::Default) }).contains("--batch"));
    assert!(error(Plan { steps: 0, ..small(Recipe::Default) }).contains("--steps"));
    assert!(error(Plan { codes: [1, 9], ..small(Recipe::Default) }).contains("--codes"));
    let many_texels = small(Recipe::Unquantised).over([256, 256]);
    assert!(error(many_texels).contains("--texels"));
    let matte = |_: DVec3, _: DVec3| DVec3::ONE;
    let anisotropic = GroundTruth::Function { eval: &matte, is_isotropic: false };
    let many_points = Plan { n_side: [128; 2], pairs: 1 << 19, ..small(Recipe::Unquantised) };
    assert!(Session::new(many_points, &anisotropic).map(|_| ()).unwrap_err().to_string().contains("--n-side"));
    assert!(error(Plan { n_side: [128; 2], ..small(Recipe::Default).for_samples(9) }).contains("--n-side"));
    for value in [f32::NAN, f32::INFINITY, -0.5] {
        let eval = |wo: DVec3, _: DVec3| DVec3::new(0.1, if wo.z < 0.5 { value.into() } else { 0.1 }, 0.1);
        let pairs =
            vec![Pair { wo: glam::Vec3::Z, wi: glam::Vec3::Z, value: glam::Vec3::splat(value), ..Pair::default() }];
        for truth in [isotropic(&eval), GroundTruth::Samples { pairs: &pairs, is_isotropic: true }] {
            let error = Session::new(small(Recipe::Default), &truth).map(|_| ()).unwrap_err().to_string();
            assert!(error.contains("ωo [") && error.contains(&value.to_string()), "{error}");
        }
    }
    for wo in [glam::Vec3::NEG_Z, glam::Vec3::ZERO, glam::Vec3::NAN] {
        let pairs = vec![Pair { wo, wi: glam::Vec3::Z, value: glam::Vec3::ONE, ..Pair::default() }];
        let truth = GroundTruth::Samples { pairs: &pairs, is_isotropic: true };
        let error = Session::new(small(Recipe::Default), &truth).map(|_| ()).unwrap_err().to_string();
        assert!(error.contains(&format!("ωo {wo}")), "{error}");
    }
    let nothing = GroundTruth::Samples { pairs: &[], is_isotropic: true };
    assert!(Session::new(small(Recipe::Default), &nothing).is_err());
}
