//! Any bytes as sparse samples.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| neubrdf_fuzz::load_brdf("a.csv", bytes));
