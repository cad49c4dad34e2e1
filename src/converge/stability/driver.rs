//! Hard circumstances.

use super::build::still_life;
use super::{Case, Expected, Trial};
use crate::render::Options;

pub fn cases() -> Vec<Case> {
    let pool = |paths| Options { traversal: None, pool_paths: Some(paths) };
    let trial = |paths| {
        let mut trial = Trial::new(still_life(1.0)).samples(3).expecting(Expected::SameBits(Options::default()));
        (trial.scene.film.width, trial.scene.film.height) = (9, 7);
        trial.options = pool(paths);
        trial
    };
    vec![
        trial(1).case("a pool of one path", "every path is a batch of its own"),
        trial(7).case("a pool of 7 paths", "batches end within pixels"),
        trial(1 << 20).case("a pool larger than the picture", "most of it stays empty"),
    ]
}
