//! Any bytes as the scene's `a.safetensors`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| neubrdf_fuzz::load_with("a.safetensors", bytes));
