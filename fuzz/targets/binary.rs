//! Any bytes as a MERL table.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| neubrdf_fuzz::load_brdf("a.binary", bytes));
