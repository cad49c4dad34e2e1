//! The networks that are tested.

use std::sync::Arc;

use glam::DVec3;
use neubrdf::material::Evaluate;
use neubrdf::scene::Brdf;

pub use crate::common::networks::all;
use crate::configurations::Configuration;

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
