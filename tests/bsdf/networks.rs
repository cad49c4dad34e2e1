//! NBRDF networks to test with: published ones where `../shared` has them, and some that are made here.

use std::path::Path;
use std::sync::Arc;

use glam::DVec3;
use neubrdf::material::Evaluate;

use neubrdf::scene::{Brdf, Nbrdf};

use crate::configurations::Configuration;

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

/// The networks with their names.
pub fn all() -> Vec<(String, Arc<Brdf>)> {
    let mut networks = Vec::new();
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

/// Each network seen from somewhere.
pub fn configurations() -> Vec<Configuration> {
    let angles = [(0.0, 0.0), (30.0, 10.0), (60.0, -70.0), (80.0, 200.0), (45.0, 120.0), (89.0, 0.0)];
    let seen = |(network, (theta, phi)): (&(String, Arc<Brdf>), _)| Configuration::measured(network, theta, phi);
    all().iter().zip(angles.into_iter().cycle()).map(seen).collect()
}

/// f at normal incidence, straight back.
#[test]
fn published_networks_have_their_published_values() {
    let expected = [
        ("alum-bronze", [3.221, 1.339, 0.506]),
        ("chrome-steel", [204.84, 182.26, 492.64]),
        ("white-paint", [0.215, 0.210, 0.211]),
    ];
    let networks = all();
    for (name, values) in expected {
        let Some((_, brdf)) = networks.iter().find(|(known, _)| known == name) else { return };
        let found = brdf.eval(DVec3::Z, DVec3::Z);
        assert!((found / DVec3::from(values) - 1.0).abs().max_element() < 3e-3, "{name}: {found}, not {values:?}");
    }
}
