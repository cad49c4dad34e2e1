//! Time to an error of a sphere of NeuBRDF, ours and Mitsuba's: the same network, of the paper's size, with random weights.

use anyhow::Result;
use neubrdf::material::fit_lobe;
use neubrdf::render::Sampler;
use neubrdf::scene::brdf::{Dense, NeuBrdf, SphereTable};
use serde_json::{Value, json};

use crate::ball::{ALPHA, network, scene};
use crate::error::{Ours, cache_directory, climb};

pub fn run() -> Result<()> {
    let brdf = network();
    let file = cache_directory()?.join("sphere.json");
    std::fs::write(&file, for_mitsuba(&brdf).to_string())?;
    // Files of trained networks have lobes that were fitted to them.
    let lobe = fit_lobe(brdf.is_isotropic_about_z(), &|wo, wi| brdf.eval(wo, wi));
    let fitted = scene(NeuBrdf { lobe, ..brdf.clone() });
    let fitted = Ours { words: ", lobe fitted", ..Ours::plain(&fitted, Sampler::Sobol) };
    let given = scene(brdf);
    climb("sphere", &[Ours::plain(&given, Sampler::Sobol), fitted, Ours::plain(&given, Sampler::Pcg)], &file)
}

/// As benches/mitsuba_neubrdf.py reads it.
fn for_mitsuba(brdf: &NeuBrdf) -> Value {
    let table = |table: &SphereTable| json!({ "codes": table.codebook.codes, "indices": table.indices });
    let layer = |layer: &Dense| json!({ "weights": layer.weights, "bias": layer.bias });
    json!({
        "n_side": brdf.wi.grid.n_side(),
        "features": brdf.wi.codebook.features,
        "alpha": ALPHA,
        "wi": table(&brdf.wi),
        "wo": table(&brdf.wo),
        "layers": brdf.layers.iter().map(layer).collect::<Vec<_>>(),
        "gain": brdf.encoding.gain,
        "scale": brdf.encoding.scale,
        "max": brdf.encoding.max,
    })
}
