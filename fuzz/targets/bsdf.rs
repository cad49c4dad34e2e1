//! Any bytes as an RGL tensor file.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| neubrdf_fuzz::load_brdf("a.bsdf", bytes));
