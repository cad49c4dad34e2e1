//! The hard cases hold, and the validation layer has nothing to say about them.
#![cfg(feature = "embree")]

mod common;

use common::*;
use neubrdf::converge::stability::cases;

#[test]
fn hard_cases_hold() {
    let Some(driver) = driver(LAVAPIPE) else { return };
    let mut broken = Vec::new();
    for case in cases() {
        let outcome = case.run(&driver.device);
        println!("{}: {}", case.name, outcome.message);
        if case.is_known_limit && outcome.holds {
            broken.push(format!("{} holds now: it is no known limit any more ({})", case.name, outcome.message));
        }
        if !case.is_known_limit && !outcome.holds {
            broken.push(format!("{} ({}): {}", case.name, case.why, outcome.message));
        }
    }
    assert!(broken.is_empty(), "{}", broken.join("\n"));
    driver.finish();
}

#[test]
fn cases_have_names_of_their_own() {
    let mut names: Vec<_> = cases().iter().map(|case| case.name).collect();
    let count = names.len();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), count);
}
