//! `make study-fit`: fits networks and closed forms, and prints how good the fits are.
use std::time::Instant;

use glam::DVec3;
use neubrdf::scene::brdf::{Brdf, NeuBrdf, Precision};
use neubrdf::material::Evaluate;
use neubrdf::train::{*, measure::*};
use rayon::prelude::*;

fn cpu() -> f64 {
    let s = std::fs::read_to_string("/proc/self/stat").unwrap();
    let f: Vec<&str> = s.rsplit(')').next().unwrap().split_whitespace().collect();
    (f[11].parse::<f64>().unwrap() + f[12].parse::<f64>().unwrap()) / 100.0
}
fn ggx(ax: f64, ay: f64, f0: DVec3, base: DVec3, wo: DVec3, wi: DVec3) -> DVec3 {
    let m = (wo + wi).normalize();
    let d = 1.0 / (std::f64::consts::PI * ax * ay * ((m.x / ax).powi(2) + (m.y / ay).powi(2) + m.z * m.z).powi(2));
    let l = |w: DVec3| ((1.0 + ((ax * w.x).powi(2) + (ay * w.y).powi(2)) / (w.z * w.z)).sqrt() - 1.0) / 2.0;
    let g = 1.0 / (1.0 + l(wo) + l(wi));
    let f = f0 + (DVec3::ONE - f0) * (1.0 - wo.dot(m)).powi(5);
    f * d * g / (4.0 * wo.z * wi.z) + base / std::f64::consts::PI
}
fn main() {
    let names = std::env::args().nth(1).unwrap();
    for name in names.split(',') {
        let brdf = ["merl", "rgl-isotropic", "nielsen"].iter().find_map(|f| Brdf::load(format!("../shared/data/nbrdf/{f}.safetensors"), Some(name)).ok());
        let iso = !name.starts_with("aniso");
        let eval = |wo: DVec3, wi: DVec3| match name {
            "aniso" => ggx(0.05, 0.3, DVec3::new(0.95, 0.8, 0.5), DVec3::ZERO, wo, wi),
            "aniso2" => ggx(0.1, 0.4, DVec3::splat(0.04), DVec3::new(0.4, 0.1, 0.05), wo, wi),
            "ggx" => ggx(0.1, 0.1, DVec3::splat(0.04), DVec3::new(0.4, 0.1, 0.05), wo, wi),
            _ => brdf.as_ref().unwrap().eval(wo, wi),
        };
        let arg = |key: &str| std::env::args().rev().find_map(|a| a.strip_prefix(&format!("{key}=")).map(|v| v.to_owned()));
        let model = if arg("nbrdf").is_some() { Model::Nbrdf } else { Model::NeuBrdf };
        let recipe = match arg("recipe").as_deref() { Some("paper") => Recipe::Paper, _ => Recipe::Default };
        let quality = match arg("quality").as_deref() { Some("draft") => Quality::Draft, Some("best") => Quality::Best, _ => Quality::Default };
        let mut plan = Plan::new(model, recipe, quality, iso);
        if let Some(v) = arg("steps") { plan.steps = v.parse().unwrap(); }
        if let Some(v) = arg("batch") { plan.batch = v.parse().unwrap(); }
        if let Some(v) = arg("f") { plan.features = v.parse().unwrap(); }
        if let Some(v) = arg("codes") { plan.codes = [v.parse().unwrap(); 2]; }
        if let Some(v) = arg("n") { plan.n_side = [v.parse().unwrap(); 2]; }
        if let Some(v) = arg("ni") { plan.n_side[0] = v.parse().unwrap(); }
        if let Some(v) = arg("hidden") { plan.hidden = v.parse().unwrap(); plan.pruned = plan.pruned.min(plan.hidden); }
        if let Some(v) = arg("lr") { plan.network_rate = v.parse().unwrap(); }
        if let Some(v) = arg("lrt") { plan.table_rate = v.parse().unwrap(); }
        let t = Instant::now();
        let c = cpu();
        let mut session = Session::new(plan, &GroundTruth::Function { eval: &eval, is_isotropic: iso }).unwrap();
        while !session.is_done() { session.step(); }
        let (wall, train) = (t.elapsed().as_secs_f64(), cpu() - c);
        let mut bytes = 1350;
        let evaluator = match session.neubrdf() {
            Some(brdf) => {
                let file = brdf.encode(Precision::F16).unwrap();
                bytes = file.len();
                Evaluator::neubrdf(&NeuBrdf::decode(&file).unwrap())
            }
            None => session.evaluator(),
        };
        let fit = |pairs: &[[DVec3; 2]]| evaluator.eval(pairs);
        let truth = |pairs: &[[DVec3; 2]]| -> Vec<DVec3> { pairs.par_iter().map(|[wo, wi]| eval(*wo, *wi)).collect() };
        let c2 = cpu();
        let FitErrors { pairs, ball, albedo, worst_albedo } = compare(96, iso, &fit, &truth).errors;
        let list: String = albedo.iter().map(|a| format!("{:+.2} ", 100.0 * a.relative())).collect();
        println!("{name} [{}] loss {:.5} log {:.5} rmse {:.4} ssim {:.4} psnr {:.2} flip {:.4} albedo {:.2} % ({list}) bytes {bytes} wall {wall:.1} cpu {train:.1} + {:.1}",
            std::env::args().skip(2).collect::<Vec<_>>().join(" "), session.loss(), pairs.log, pairs.relative_rmse, ball.ssim, ball.psnr, ball.flip, 100.0 * worst_albedo, cpu() - c2);
    }
}
