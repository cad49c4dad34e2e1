//! A study's findings for the terminal.

use std::fmt::Write;

use super::analysis::{Analysis, ratio};
use super::gate::Verdict;
use super::html::SIGNIFICANCE;
use super::record::Record;
use super::versus::{Change, Versus};
use crate::converge::{CONFIDENCE, Estimate};

/// A line a method.
pub fn summary_text(record: &Record, analysis: &Analysis) -> String {
    let mut text = String::new();
    for (scene, result) in record.scenes.iter().zip(&analysis.scenes) {
        let widest = scene.methods.iter().map(|method| method.label.chars().count()).max().unwrap_or(0);
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{}", scene.name);
        for method in &scene.methods {
            let label = &method.label;
            let missing = method.unavailable.as_ref().map(|reason| format!("not available: {reason}"));
            let Some(found) = result.methods.iter().find(|found| found.name == method.name) else {
                if let Some(missing) = missing {
                    let _ = writeln!(text, "  {label:widest$}  {missing}");
                }
                continue;
            };
            // Of a device that a resumed study no longer finds.
            let missing = missing.map_or(String::new(), |missing| format!("; the rest is {missing}"));
            let bias = match found.bias_p {
                Some(p) if p < SIGNIFICANCE || p.is_nan() => format!("BIASED (p = {p:.1e})"),
                Some(p) => format!("no bias seen (p = {p:.2})"),
                None => "bias not tested".into(),
            };
            let number = |estimate: Option<Estimate>| {
                estimate.map_or("?".into(), |estimate| {
                    let [low, high] = estimate.interval(CONFIDENCE);
                    format!("{:.2} ({low:.2} to {high:.2})", estimate.value)
                })
            };
            let top = found.top().map_or(String::new(), |rung| {
                format!("relMSE {:.2e} in {:.2} s at {} spp", rung.rel_mse.value, rung.seconds.value, rung.spp)
            });
            let floor = match (found.has_floor, found.floor) {
                (true, Some(floor)) => format!(", floor {:.2e}", floor.value),
                _ => String::new(),
            };
            let efficiency = found.efficiency.map_or("?".into(), |efficiency| format!("{:.3e}", ratio(&efficiency)[0]));
            let _ = writeln!(
                text,
                "  {label:widest$}  {top}, slope {}, efficiency {efficiency}{floor}; {bias}{missing}",
                number(found.slope)
            );
        }
    }
    text
}

/// A line a threshold.
pub fn verdict_lines(verdicts: &[Verdict]) -> String {
    verdicts.iter().map(|verdict| format!("{} {}\n", if verdict.holds { "✓" } else { "✗" }, verdict.message)).collect()
}

/// A line a change, and one for each scene that does not compare.
pub fn change_lines(versus: &Versus) -> String {
    let line = |change: &Change| {
        let [value, low, high] = change.ratio;
        let word = match change.is_better() {
            Some(true) => "better",
            Some(false) => "worse ",
            None => "same  ",
        };
        format!("{word} {}, {}: {} × {value:.3} ({low:.3} to {high:.3})\n", change.scene, change.method, change.figure)
    };
    let left_out = versus.left_out.iter().map(|(scene, reason)| format!("not compared: {scene}: {reason}\n"));
    versus.changes.iter().map(line).chain(left_out).collect()
}
