//! Networks to test with: published ones where `../shared` has them, and some that are made here.

use std::path::Path;
use std::sync::Arc;

use neubrdf::scene::brdf::NeuBrdf;
use neubrdf::scene::{Brdf, Nbrdf};

use super::random_neubrdf::{Shape, random_neubrdf};

/// From matte to mirror-like.
const PUBLISHED: [(&str, &[&str]); 2] = [
    (
        "merl",
        &[
            "white-fabric",
            "pink-felt",
            "pure-rubber",
            "white-paint",
            "red-plastic",
            "gold-metallic-paint",
            "alum-bronze",
            "specular-maroon-phenolic",
            "black-obsidian",
            "two-layer-gold",
            "steel",
            "chrome",
            "chrome-steel",
        ],
    ),
    ("rgl-isotropic", &["spectralon_rgb", "satin_purple_rgb", "ilm_l3_37_metallic_rgb"]),
];

/// NeuBRDFs of other shapes each, small enough for their definition to be evaluated often, and never close to 0, where a network's
/// rounding is all that is left of a value. Two of them share their codebooks.
pub fn neubrdfs() -> Vec<(String, Arc<Brdf>)> {
    let small = Shape { n_side: 4, features: 4, codes: 60, hidden: &[12, 16, 12], ..Shape::FULL };
    // The first two have codes of one seed, and share their codebooks as members of a pack do.
    let shapes = [
        ("anisotropic", 0, small),
        ("isotropic", 0, Shape { is_isotropic: true, is_pruned: true, n_side: 16, hidden: &[16, 8], ..small }),
        ("varying", 2, Shape { surface: Some(([5, 4], 3)), ..small }),
        ("varying, isotropic", 3, Shape { is_isotropic: true, n_side: 8, surface: Some(([8, 8], 8)), ..small }),
        ("of two resolutions", 4, Shape { n_side: 8, resolutions: 2, ..small }),
        ("with the half vector", 6, Shape { sees_half_vector: true, is_isotropic: true, ..small }),
        ("of one pixel size", 5, Shape { n_side: 1, features: 2, hidden: &[7], ..small }),
    ];
    let mut models: Vec<NeuBrdf> = shapes.iter().map(|(_, seed, shape)| random_neubrdf(*shape, *seed)).collect();
    let (wi, wo) = (models[0].wi.codebook.clone(), models[0].wo.codebook.clone());
    assert!(models[1].wi.codebook == wi && models[1].wo.codebook == wo);
    (models[1].wi.codebook, models[1].wo.codebook) = (wi, wo);
    let make = |((name, ..), mut model): (&(&str, u64, Shape), NeuBrdf)| {
        let last = model.layers.last_mut().unwrap();
        last.weights.iter_mut().for_each(|weight| *weight *= 0.25);
        last.bias = vec![0.75, 1.0, 0.5];
        (format!("NeuBRDF, {name}"), Arc::new(Brdf::NeuBrdf(Box::new(model))))
    };
    shapes.iter().zip(models).map(make).collect()
}

/// The networks with their names.
pub fn all() -> Vec<(String, Arc<Brdf>)> {
    let mut networks = neubrdfs();
    for (peak, slope, base) in
        [(0.2, 0.3, 0.2), (1.0, 4.0, 0.1), (3.0, 20.0, 0.05), (5.0, 60.0, 0.02), (7.0, 300.0, 0.0)]
    {
        let name = format!("made, peak e^{peak}, slope {slope}");
        networks.push((name, Arc::new(Brdf::Nbrdf(made(peak, slope, base)))));
    }
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data/nbrdf");
    if !folder.is_dir() {
        eprintln!("{} is missing: only networks that the test makes itself are tested", folder.display());
        return networks;
    }
    for (file, names) in PUBLISHED {
        let path = folder.join(file).with_extension("safetensors");
        let load = |name: &&str| (name.to_string(), Arc::new(Brdf::load(&path, Some(name)).unwrap()));
        networks.extend(names.iter().map(load));
    }
    networks
}

/// ln(1 + f) is a cone of this height and slope over sin θh, on a base that rises towards grazing angles; of other colours in each
/// channel.
pub fn made(peak: f32, slope: f32, base: f32) -> Nbrdf {
    let mut network = Nbrdf {
        kernel_1: [[0.0; 21]; 6],
        bias_1: [0.0; 21],
        kernel_2: [[0.0; 21]; 21],
        bias_2: [0.0; 21],
        kernel_3: [[0.0; 3]; 21],
        bias_3: [base, 0.5 * base, 0.8 * base],
    };
    network.kernel_1[0][0] = 1.0;
    network.kernel_1[5][1] = -1.0;
    network.bias_1[1] = 1.0;
    network.kernel_2[0][0] = -slope;
    network.bias_2[0] = peak;
    network.kernel_2[1][1] = 1.0;
    network.bias_2[1] = -0.3;
    network.kernel_3[0] = [1.0, 0.9, 0.7];
    network.kernel_3[1] = [0.5, 0.5, 0.6];
    network
}

/// A safetensors file of networks.
pub fn safetensors(networks: &[(&str, &Nbrdf)]) -> Vec<u8> {
    let mut header = serde_json::Map::new();
    let mut data: Vec<u8> = Vec::new();
    for (name, network) in networks {
        for (tensor, shape, numbers) in tensors(network) {
            let start = data.len();
            data.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
            let entry = serde_json::json!({ "dtype": "F32", "shape": shape, "data_offsets": [start, data.len()] });
            header.insert(format!("{name}/{tensor}"), entry);
        }
    }
    let header = serde_json::to_vec(&header).unwrap();
    [&(header.len() as u64).to_le_bytes(), header.as_slice(), &data].concat()
}

/// The tensors of a network: name, shape, numbers.
pub fn tensors(network: &Nbrdf) -> [(&'static str, Vec<usize>, Vec<f32>); 6] {
    [
        ("kernel1", vec![6, 21], network.kernel_1.as_flattened().to_vec()),
        ("bias1", vec![21], network.bias_1.to_vec()),
        ("kernel2", vec![21, 21], network.kernel_2.as_flattened().to_vec()),
        ("bias2", vec![21], network.bias_2.to_vec()),
        ("kernel3", vec![21, 3], network.kernel_3.as_flattened().to_vec()),
        ("bias3", vec![3], network.bias_3.to_vec()),
    ]
}
