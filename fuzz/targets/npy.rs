//! Any bytes as the scene's `a_fc1.npy`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| neubrdf_fuzz::load_with("a_fc1.npy", bytes));
