//! Any bytes as a `.neubrdf` file, with a checksum that fits them: what loads can be evaluated.
#![no_main]

use glam::DVec3;
use neubrdf::scene::brdf::NeuBrdfPack;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let content = &bytes[..bytes.len().saturating_sub(32)];
    if let Ok(pack) = NeuBrdfPack::decode(&[content, blake3::hash(content).as_bytes()].concat()) {
        for (_, brdf) in pack.materials {
            for w in [DVec3::Z, DVec3::new(-0.6, 0.0, 0.8), DVec3::new(0.6, -0.8, 1e-6)] {
                let value = brdf.eval(w, DVec3::Z);
                assert!(value.is_finite() && value.min_element() >= 0.0);
            }
        }
    }
});
