//! Any bytes as the scene's `a.mtl`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| neubrdf_fuzz::load_with("a.mtl", bytes));
