//! Any bytes as the scene's `a.exr`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| neubrdf_fuzz::load_with("a.exr", bytes));
