//! How much variance the sampling of BRDFs without a sampler of their own leaves: `cargo bench --bench sampling [-- NAME…]`.
//!
//! For one sample of ∫f cos θi dωi (a uniform sky), the variance over the square of the mean, as means over eight ωo of evenly spread cos θo:
//! by the fitted lobe, by a cosine hemisphere and by a uniform one. All are integrated with the same points, which lobes of many
//! widths have picked. The published networks are those of `../shared/data/nbrdf`.

use std::f64::consts::{FRAC_1_PI, FRAC_PI_2, TAU};
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use glam::{DVec2, DVec3, Vec2, Vec3};
use neubrdf::material::{Bsdf, Evaluate, Ggx, Prepared, fit_lobe};
use neubrdf::scene::{Brdf, Color, Fresnel, SamplingLobe, Surface};
use rayon::prelude::*;

/// The α of the lobes that pick points.
const WIDTHS: [f64; 9] = [0.7, 0.35, 0.18, 0.09, 0.045, 0.022, 0.011, 0.005, 0.002];
/// Points that each of them picks a view, and the hemisphere too.
const POINTS: u32 = 4096;
const VIEWS: u32 = 8;

/// A surface whose own sampler is set aside.
#[derive(Debug)]
struct Analytic(Prepared);

impl Evaluate for Analytic {
    fn eval(&self, wo: DVec3, wi: DVec3) -> DVec3 {
        Bsdf::new(&self.0, DVec3::ONE).eval(wo, wi)
    }

    fn is_isotropic(&self) -> bool {
        false
    }
}

struct Row {
    name: String,
    lobe: SamplingLobe,
    fit_seconds: f64,
    /// By lobe, cosine and uniform hemisphere.
    variances: [f64; 3],
}

fn main() {
    let wanted: Vec<String> = std::env::args().skip(1).filter(|argument| !argument.starts_with("--")).collect();
    let is_wanted = |name: &str| wanted.is_empty() || wanted.iter().any(|wanted| name.contains(wanted.as_str()));
    let mut brdfs: Vec<(String, Arc<dyn Evaluate>)> = Vec::new();
    for file in ["merl", "rgl-isotropic"] {
        let path =
            Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data/nbrdf").join(file).with_extension("safetensors");
        for name in names(&path) {
            match Brdf::load(&path, Some(&name)) {
                Ok(brdf) => brdfs.push((name, Arc::new(brdf))),
                Err(error) => return eprintln!("{error}"),
            }
        }
    }
    for alpha in [[0.02, 0.02], [0.05, 0.3], [0.3, 0.05], [0.1, 0.5], [0.01, 0.1]] {
        let fresnel = Fresnel::Schlick { f0: Color::constant(Vec3::ONE) };
        let surface = Surface::Conductor { fresnel, alpha: Vec2::from(alpha) };
        let name = format!("GGX {} × {}", alpha[0], alpha[1]);
        brdfs.push((name, Arc::new(Analytic(Prepared::new(&surface, &[])))));
    }

    let mut rows: Vec<Row> =
        brdfs.into_iter().filter(|(name, _)| is_wanted(name)).map(|(name, brdf)| row(name, brdf)).collect();
    rows.sort_by(|a, b| a.variances[1].total_cmp(&b.variances[1]));
    println!(
        "{:30} {:>7} {:>7} {:>11} {:>11} {:>8} {:>8} {:>9} {:>8} {:>8} {:>6}",
        "", "α", "α", "w grazing", "w above", "lobes", "cosine", "uniform", "cos/lobe", "uni/lobe", "fit ms"
    );
    for Row { name, lobe, fit_seconds, variances: [own, cosine, uniform] } in &rows {
        let [narrow, wide] = lobe.alpha.map(|[x, y]| if x == y { format!("{x:.4}") } else { format!("{x:.3}×{y:.3}") });
        let [grazing, above] =
            [lobe.weight[1], lobe.weight[SamplingLobe::NODES - 1]].map(|[a, b]| format!("{a:.2} {b:.2}"));
        println!(
            "{name:30} {narrow:>7} {wide:>7} {grazing:>11} {above:>11} {own:8.3} {cosine:8.1} {uniform:9.1} {:8.1} {:8.1} {:6.0}",
            cosine / own,
            uniform / own,
            1e3 * fit_seconds
        );
    }
    let gains: Vec<f64> = rows[rows.len() / 2..].iter().map(|row| row.variances[1] / row.variances[0]).collect();
    let least = gains.iter().copied().fold(f64::INFINITY, f64::min);
    let mean = (gains.iter().map(|gain| gain.ln()).sum::<f64>() / gains.len() as f64).exp();
    println!("cosine / lobe on the glossier half ({}): least {least:.1}, geometric mean {mean:.1}", gains.len());
    println!("{} of them at least 10", gains.iter().filter(|gain| **gain >= 10.0).count());
}

/// The materials of a safetensors file, from its header.
fn names(path: &Path) -> Vec<String> {
    let Ok(bytes) = std::fs::read(path) else {
        eprintln!("{} is missing", path.display());
        return Vec::new();
    };
    let text = String::from_utf8_lossy(&bytes[8..]).into_owned();
    text.split('"').filter_map(|word| word.strip_suffix("/kernel1")).map(str::to_owned).collect()
}

fn row(name: String, brdf: Arc<dyn Evaluate>) -> Row {
    let start = Instant::now();
    let lobe = fit_lobe(brdf.is_isotropic(), &|wo, wi| brdf.eval(wo, wi));
    let fit_seconds = start.elapsed().as_secs_f64();
    let prepared = Prepared::LobeSampled { brdf, lobe };
    let bsdf = Bsdf::new(&prepared, DVec3::ONE);
    let of_views: Vec<[f64; 3]> = (0..VIEWS).into_par_iter().map(|view| variances(&bsdf, view)).collect();
    let variances = [0, 1, 2].map(|i| of_views.iter().map(|variances| variances[i]).sum::<f64>() / f64::from(VIEWS));
    Row { name, lobe, fit_seconds, variances }
}

/// (second moment − mean²) / mean² from one direction, by lobe, cosine and uniform hemisphere.
fn variances(bsdf: &Bsdf, view: u32) -> [f64; 3] {
    let cosine = (f64::from(view) + 0.5) / f64::from(VIEWS);
    let sine = (1.0 - cosine * cosine).sqrt();
    let (y, x) = (f64::from(view) * 0.618 * FRAC_PI_2).sin_cos();
    let wo = DVec3::new(sine * x, sine * y, cosine);
    let probes = WIDTHS.map(|alpha| Ggx { alpha: DVec2::splat(alpha) });
    let mut mean = DVec3::ZERO;
    let mut moments = [0.0; 3];
    for probe in 0..=probes.len() {
        for i in 0..POINTS {
            let u = [(f64::from(i) + 0.5) / f64::from(POINTS), f64::from(i.reverse_bits()) / 2f64.powi(32)];
            let wi = match probes.get(probe) {
                Some(ggx) => {
                    let m = ggx.sample_visible_normal(wo, u);
                    2.0 * wo.dot(m) * m - wo
                }
                None => {
                    let (y, x) = (TAU * u[1]).sin_cos();
                    DVec3::new(u[0].sqrt() * x, u[0].sqrt() * y, (1.0 - u[0]).sqrt())
                }
            };
            if wi.z < 1e-6 {
                continue;
            }
            let half = (wo + wi).normalize();
            let of_probe = |ggx: &Ggx| ggx.visible_normal_pdf(wo, half) / (4.0 * wo.dot(half));
            let density = f64::from(POINTS) * (probes.iter().map(of_probe).sum::<f64>() + wi.z * FRAC_1_PI);
            let value = bsdf.eval(wo, wi) * wi.z;
            mean += value / density;
            let squared = value.length_squared() / density;
            for (moment, pdf) in moments.iter_mut().zip([bsdf.pdf(wo, wi), wi.z * FRAC_1_PI, 1.0 / TAU]) {
                *moment += squared / pdf;
            }
        }
    }
    moments.map(|moment| moment / mean.length_squared() - 1.0)
}
