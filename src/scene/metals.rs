//! Metals that a scene file may name.

use glam::Vec3;

use super::Fresnel;

/// Index of refraction η + iκ at 650, 550 and 450 nm, for red, green and blue: linear interpolation in the luxpop.com
/// tables of optical constants (the ones that PBRT and Mitsuba ship as spectra).
const METALS: [(&str, [f32; 3], [f32; 3]); 5] = [
    ("aluminium", [1.475, 0.959, 0.618], [7.794, 6.687, 5.469]),
    ("chromium", [3.638, 3.116, 1.928], [4.364, 4.423, 4.168]),
    ("copper", [0.217, 0.958, 1.166], [3.638, 2.577, 2.394]),
    ("gold", [0.168, 0.350, 1.508], [3.138, 2.714, 1.879]),
    ("silver", [0.139, 0.125, 0.152], [4.129, 3.340, 2.470]),
];

/// The reflectance of a metal by its name.
pub(super) fn metal(name: &str) -> Option<Fresnel> {
    METALS
        .iter()
        .find(|(known, ..)| *known == name)
        .map(|&(_, eta, kappa)| Fresnel::Complex { eta: Vec3::from_array(eta), kappa: Vec3::from_array(kappa) })
}

/// All names that [`metal`] knows.
pub(super) fn names() -> impl Iterator<Item = &'static str> {
    METALS.iter().map(|(name, ..)| *name)
}
