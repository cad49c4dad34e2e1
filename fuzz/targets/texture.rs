//! Any bytes as a texture, whatever its kind.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| neubrdf_fuzz::load_with("a.png", bytes));
