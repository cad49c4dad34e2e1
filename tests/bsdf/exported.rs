//! Exported modules evaluate and sample as the definitions say.

use std::path::Path;
use std::sync::Arc;

use glam::{DVec3, Vec3};
use neubrdf::export::{Exported, ExportedAnswer, ExportedQuery, Language, Place, Prefix, export};
use neubrdf::material::Prepared;
use neubrdf::scene::brdf::NeuBrdf;
use neubrdf::scene::{Brdf, Surface};
use rayon::prelude::*;

use crate::common::bsdf_structs::{BsdfTestCase, BsdfTestResult};
use crate::common::networks::neubrdfs;
use crate::configurations::Configuration;
use crate::device::{Parity, as_material, case, cases};
use crate::on_wgpu::OnWgpu;
use crate::sampling::{Histogram, SAMPLES, judge, write_evidence};
use crate::sphere::Random;

/// What is exported as one module: small networks, and two of those that are shipped.
fn brdfs() -> Vec<(String, Arc<Brdf>)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/materials");
    let load = |name: &str| Brdf::load(folder.join(name).with_extension("neubrdf"), None).unwrap();
    let shipped = ["chrome_polished", "aluminium_brushed"].map(|name| (name.to_owned(), Arc::new(load(name))));
    neubrdfs().into_iter().chain(shipped).collect()
}

fn exported(brdfs: &[(String, Arc<Brdf>)]) -> Exported {
    let model = |brdf: &Brdf| match brdf {
        Brdf::NeuBrdf(model) => NeuBrdf::clone(model),
        other => panic!("{other:?}"),
    };
    let models: Vec<_> = brdfs.iter().map(|(name, brdf)| (name.clone(), model(brdf))).collect();
    export(&models, Language::Wgsl, Place::default(), &Prefix::default()).unwrap()
}

/// The query that asks what a case asks, where materials are models.
fn query(exported: &Exported, case: &BsdfTestCase) -> ExportedQuery {
    let model = exported.models[case.material as usize].first_word;
    ExportedQuery { wo: case.wo, model, wi: case.wi, u: case.u, ..ExportedQuery::default() }
}

#[test]
fn exported_modules_agree_with_the_definitions() {
    let Some(gpu) = OnWgpu::new() else { return };
    let named = brdfs();
    let exported = exported(&named);
    let brdfs: Vec<_> = named.into_iter().map(|(_, brdf)| brdf).collect();
    let surfaces: Vec<_> = (0..brdfs.len() as u32).map(|brdf| Surface::Measured { brdf }).collect();
    let prepared = Prepared::all(&surfaces.iter().map(as_material).collect::<Vec<_>>(), &brdfs);
    let cases = cases(&surfaces, &prepared, 50_000);
    let queries: Vec<_> = cases.iter().map(|case| query(&exported, case)).collect();
    let answers = gpu.answer(&exported, Place::default(), &queries);
    // The weights of samples take the values there.
    let again = |(query, answer): (&ExportedQuery, &ExportedAnswer)| ExportedQuery { wi: answer.sampled_wi, ..*query };
    let at_samples: Vec<_> = queries.iter().zip(&answers).map(again).collect();
    let at_samples = gpu.answer(&exported, Place::default(), &at_samples);
    let result = |(answer, at_sample): (&ExportedAnswer, &ExportedAnswer)| {
        let ExportedAnswer { f: [r, g, b], pdf, sampled_wi: wi, sampled_pdf } = *answer;
        let scale = if sampled_pdf > 0.0 { wi[2] / sampled_pdf } else { 0.0 };
        let weight = (Vec3::from(at_sample.f) * scale).into();
        BsdfTestResult { eval_pdf: [r, g, b, pdf], wi, pdf: sampled_pdf, weight, is_delta: 0 }
    };
    let results: Vec<_> = answers.iter().zip(&at_samples).map(result).collect();
    let parity = Parity::of(&surfaces, &prepared, &cases, &results, "wgpu");
    let text = parity.report("exported");
    write_evidence("bsdf_parity_exported.txt", &text);
    assert!(parity.holds(), "{text}");
}

#[test]
fn exported_modules_sample_as_the_density_says() {
    let Some(gpu) = OnWgpu::new() else { return };
    let brdfs = brdfs();
    let exported = exported(&brdfs);
    let angles = [(30.0, 10.0), (60.0, -70.0), (80.0, 200.0), (45.0, 120.0), (10.0, 0.0)];
    let from = brdfs.iter().zip(angles.into_iter().cycle());
    let seen: Vec<_> = from.map(|(brdf, (theta, phi))| Configuration::measured(brdf, theta, phi)).collect();
    let histogram = |(index, configuration): (usize, &Configuration)| {
        let mut random = Random(9000 + index as u64);
        let wo = configuration.wo.as_vec3().as_dvec3();
        // Below the surface there is nothing to evaluate.
        let cases = (0..SAMPLES).map(|_| case(index, wo, DVec3::NEG_Z, random.units()));
        let queries: Vec<_> = cases.map(|case| query(&exported, &case)).collect();
        let mut histogram = Histogram::new(configuration);
        for answer in gpu.answer(&exported, Place::default(), &queries) {
            assert_eq!([answer.f[0], answer.pdf], [0.0; 2]);
            let wi = Vec3::from(answer.sampled_wi).as_dvec3();
            histogram.add((answer.sampled_pdf > 0.0).then_some((wi, answer.sampled_pdf.into(), false)));
        }
        histogram
    };
    let histograms: Vec<_> = seen.iter().enumerate().map(histogram).collect();
    let judged = |(configuration, histogram): (&Configuration, &Histogram)| {
        let (test, integral) = histogram.test(|wi| configuration.bsdf().pdf(configuration.wo, wi));
        (histogram.report(&configuration.name, &test, integral), test.p_value, true)
    };
    let results: Vec<_> = seen.par_iter().zip(&histograms).map(judged).collect();
    judge("bsdf_chi_square_exported.txt", &results);
}
