//! Every run of a study as a table.

use std::fmt::Write;

use super::record::Record;

/// One line a run, with a head.
pub fn csv(record: &Record) -> String {
    let mut text = String::from(
        "scene,method,label,spp,repetition,seed,seconds,cpu_seconds,busy_cores_of_others,mse,rel_mse,flip,relative_bias,\
         non_finite_pixels,rejected_samples,reference_mse,reference_rel_mse\n",
    );
    for scene in &record.scenes {
        for method in &scene.methods {
            for run in &method.runs {
                // Writing to a string cannot fail.
                let _ = writeln!(
                    text,
                    "{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{}",
                    quoted(&scene.name),
                    quoted(&method.name),
                    quoted(&method.label),
                    run.spp,
                    run.repetition,
                    run.seed,
                    run.timing.seconds,
                    run.timing.cpu_seconds,
                    run.timing.others,
                    run.mse,
                    run.rel_mse,
                    run.flip,
                    run.relative_bias,
                    run.non_finite_pixels,
                    run.rejected_samples,
                    scene.truth.mse,
                    scene.truth.rel_mse,
                );
            }
        }
    }
    text
}

/// RFC 4180.
fn quoted(word: &str) -> String {
    match word.contains([',', '"', '\n']) {
        true => format!("\"{}\"", word.replace('"', "\"\"")),
        false => word.to_owned(),
    }
}
