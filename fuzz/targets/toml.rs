//! Any bytes as the scene's `scene.toml`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| neubrdf_fuzz::load_with("scene.toml", bytes));
