//! The page of a study: self-contained, the same for the same numbers.

use std::fmt::Write;
use std::path::Path;

use super::analysis::{Analysis, MethodResult, Rung, SceneResult, Target, ratio};
use super::error::Error;
use super::plan::Clock;
use super::plot::{self, Plot, Point, Series, key, plain};
use super::record::{MethodRecord, Record, SceneRecord};
use super::run::{average, directory_of, picture_file, truth_file};
use crate::converge::{CONFIDENCE, Estimate, difference_rgb8};
use crate::image::{Picture, escaped, plane, png_address, read_exr, tone_map};

/// A bias test that is less likely than this under honest noise is called a bias.
pub const SIGNIFICANCE: f64 = 0.01;
/// Thumbnails are at most this wide.
const THUMBNAIL: u32 = 256;
/// Relative difference of full colour.
const FULL_COLOR: f32 = 0.5;

/// The whole page.
pub fn page(record: &Record, analysis: &Analysis, directory: &Path) -> Result<String, Error> {
    let names: Vec<&str> = record.scenes.iter().map(|scene| scene.name.as_str()).collect();
    let mut html = format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width\"><title>Convergence: {}</title><style>{STYLE}{}</style></head><body>\n\
         <h1>Speed against error: {}</h1>\n",
        escaped(&names.join(", ")),
        plot::STYLE,
        escaped(&names.join(", "))
    );
    html.push_str(&header(record, analysis));
    for (scene, result) in record.scenes.iter().zip(&analysis.scenes) {
        html.push_str(&section(record, scene, result, directory)?);
    }
    html.push_str(&explanation(record));
    html.push_str("</body></html>\n");
    Ok(html)
}

/// What it was measured with, and what could not be.
fn header(record: &Record, analysis: &Analysis) -> String {
    let environment = &record.environment;
    let question = &record.question;
    let revision = match environment.revision.get(..12) {
        Some(revision) => format!(", commit {}", escaped(revision)),
        None => String::new(),
    };
    let clock = match question.clock {
        Clock::Wall => "wall-clock seconds",
        Clock::Cpu => "processor seconds, all threads together",
    };
    let mut devices: Vec<String> = record
        .scenes
        .iter()
        .flat_map(|scene| scene.methods.iter().filter_map(|method| Some(escaped(&method.preparation.as_ref()?.device))))
        .collect();
    devices.sort();
    devices.dedup();
    let mut html = format!(
        "<p class=\"facts\">{} · {} · {} threads, load {} · neubrdf {}{revision}{}<br>{}<br>depth {}, {} spp, {} repetitions, seed {}; \
         {clock}; {} bias tests</p>\n",
        environment.date(),
        escaped(&environment.cpu),
        environment.threads,
        escaped(&environment.load),
        escaped(&environment.version),
        if environment.is_release { "" } else { " (<b>not a release build</b>)" },
        devices.join("<br>"),
        question.max_depth,
        question.ladder.iter().map(u32::to_string).collect::<Vec<_>>().join(", "),
        question.repetitions,
        question.seed,
        analysis.bias_tests,
    );
    // A reason once, with the scenes that it holds for.
    let mut reasons: Vec<((&str, &str), Vec<&str>)> = Vec::new();
    for scene in &record.scenes {
        for method in &scene.methods {
            let Some(reason) = &method.unavailable else { continue };
            let what = (method.label.as_str(), reason.as_str());
            match reasons.iter_mut().find(|(known, _)| *known == what) {
                Some((_, scenes)) => scenes.push(&scene.name),
                None => reasons.push((what, vec![&scene.name])),
            }
        }
    }
    let line = |((label, reason), scenes): &((&str, &str), Vec<&str>)| {
        format!("<li>{} in {}: {}</li>", escaped(label), escaped(&scenes.join(", ")), escaped(reason))
    };
    let missing: Vec<String> = reasons.iter().map(line).collect();
    if !missing.is_empty() {
        let _ = writeln!(html, "<div class=\"note\"><b>Not available here</b><ul>{}</ul></div>", missing.join(""));
    }
    let methods = record.scenes.iter().flat_map(|scene| &scene.methods);
    let available: Vec<&MethodRecord> = methods.filter(|method| method.unavailable.is_none()).collect();
    let wanted = available.len() * question.ladder.len() * question.repetitions as usize;
    let done: usize = available.iter().map(|method| method.runs.len()).sum();
    if done < wanted {
        let _ = writeln!(
            html,
            "<div class=\"note\"><b>Unfinished</b>: {done} of {wanted} renders; <code>--resume</code> goes on with it.</div>"
        );
    }
    html
}

fn section(record: &Record, scene: &SceneRecord, result: &SceneResult, directory: &Path) -> Result<String, Error> {
    let [width, height] = scene.size;
    let mut html = format!(
        "<section><h2>{}</h2>\n<p class=\"facts\">{width}×{height} · reference: {}, whose own noise is relMSE {} (MSE {}){} · scene {}</p>\n",
        escaped(&scene.name),
        escaped(&scene.truth.origin),
        plain(scene.truth.rel_mse),
        plain(scene.truth.mse),
        if scene.truth.has_variance { "" } else { " as far as is known: <b>it has no variance</b>" },
        escaped(scene.hash.get(..12).unwrap_or(&scene.hash)),
    );
    html.push_str(&summary(record, scene, result));
    html.push_str("<div class=\"plots\">");
    for plot in plots(record, scene, result) {
        html.push_str(&plot.svg());
    }
    html.push_str("</div>\n");
    html.push_str(&pictures(record, scene, directory)?);
    html.push_str(&details(scene, result));
    html.push_str("</section>\n");
    Ok(html)
}

/// An estimate with its interval.
fn interval(estimate: &Estimate) -> String {
    let [low, high] = estimate.interval(CONFIDENCE);
    match (high - low).is_finite() {
        true => format!("{} <small>{} … {}</small>", plain(estimate.value), plain(low), plain(high)),
        false => plain(estimate.value),
    }
}

/// An estimate given by its logarithm.
fn log_interval(estimate: &Estimate) -> String {
    let [value, low, high] = ratio(estimate);
    match low > 0.0 && high.is_finite() {
        true => format!("{} <small>{} … {}</small>", plain(value), plain(low), plain(high)),
        false => plain(value),
    }
}

/// The main table: a method a row.
fn summary(record: &Record, scene: &SceneRecord, result: &SceneResult) -> String {
    let targets: String =
        record.question.targets.iter().map(|target| format!("<th>s to relMSE {}</th>", plain(*target))).collect();
    let mut html = format!(
        "<table><thead><tr><th></th><th>method</th><th>biased?</th><th>slope</th><th>efficiency, relative</th>{targets}\
         <th>error floor (relMSE)</th><th>build + first pass</th></tr></thead><tbody>\n"
    );
    let base = result.methods.first().and_then(|method| method.efficiency);
    for (style, method) in result.methods.iter().enumerate() {
        let entry = scene.methods.iter().find(|entry| entry.name == method.name);
        let relative = match (method.efficiency, base) {
            _ if style == 0 => "1".into(),
            (Some(own), Some(base)) => log_interval(&own.minus(&base)),
            _ => "–".into(),
        };
        let targets: String = method.targets.iter().map(|target| format!("<td>{}</td>", time_to(target))).collect();
        let preparation = entry.and_then(|entry| entry.preparation.as_ref()).map_or("–".into(), |preparation| {
            format!("{} + {} s", plain(preparation.build_seconds), plain(preparation.first_pass_seconds))
        });
        let _ = writeln!(
            html,
            "<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{relative}</td>{targets}<td>{}</td><td>{preparation}</td></tr>",
            key(style),
            escaped(&method.label),
            bias(method, entry),
            method.slope.map_or("–".into(), |slope| interval(&slope)),
            floor(method),
        );
    }
    html + "</tbody></table>\n"
}

fn time_to(target: &Target) -> String {
    match (&target.seconds, target.is_below_floor) {
        (_, true) => "never".into(),
        (Some(seconds), _) if target.is_extrapolated => format!("<i>{}</i>", log_interval(seconds)),
        (Some(seconds), _) => log_interval(seconds),
        (None, _) => "–".into(),
    }
}

fn bias(method: &MethodResult, entry: Option<&MethodRecord>) -> String {
    let Some(test) = entry.and_then(|entry| entry.bias.as_ref()) else { return "not tested".into() };
    let p = method.bias_p.unwrap_or(f64::NAN);
    let against = entry.and_then(|entry| entry.model.as_ref()).map_or("", |_| ", as an estimator of its model");
    let title = format!(
        "{} spp against {} spp{against}: p of blocks of {b} × {b} pixels {:.2e}, of the mean {:.2e}; worst block at {:?}, z {:+.2}; z rms {:.3}; mean differs by {:+.2e}",
        test.spp,
        test.reference_spp,
        test.p_blocks,
        test.p_mean,
        test.worst_pixel,
        test.worst_z,
        test.z_rms,
        test.relative_bias,
        b = test.block
    );
    match p < SIGNIFICANCE || p.is_nan() {
        true => format!("<b class=\"bad\" title=\"{title}\">✗ yes</b> <small>p = {p:.1e}</small>"),
        false => format!("<span class=\"good\" title=\"{title}\">✓ not seen</span> <small>p = {p:.2}</small>"),
    }
}

fn floor(method: &MethodResult) -> String {
    match (method.has_floor, &method.floor) {
        (true, Some(floor)) => {
            let reached = method
                .floor_reached
                .map_or(String::new(), |time| format!("; noise sinks below it after {} s", log_interval(&time)));
            format!("<b>{}</b>{reached}", interval(floor))
        }
        (_, Some(floor)) if floor.standard_error.is_finite() => {
            format!("none seen <small>&lt; {}</small>", plain(floor.interval(CONFIDENCE)[1].max(0.0)))
        }
        _ => "not known".into(),
    }
}

fn plots(record: &Record, scene: &SceneRecord, result: &SceneResult) -> [Plot; 4] {
    let seconds = match record.question.clock {
        Clock::Wall => "seconds",
        Clock::Cpu => "processor seconds",
    };
    let time: fn(&Rung) -> f64 = |rung| rung.seconds.value;
    let samples: fn(&Rung) -> f64 = |rung| f64::from(rung.spp);
    let relative: fn(&Rung) -> Estimate = |rung| rung.rel_mse;
    let plain: fn(&Rung) -> Estimate = |rung| rung.mse;
    let plot = |metric: &str, error: fn(&Rung) -> Estimate, x_label: &str, x: fn(&Rung) -> f64, noise: f64| {
        let series = result.methods.iter().enumerate().map(|(style, method)| Series {
            style,
            title: method.label.clone(),
            points: method
                .rungs
                .iter()
                .map(|rung| {
                    let error = error(rung);
                    Point {
                        x: x(rung),
                        y: error.value,
                        interval: error.interval(CONFIDENCE).map(|end| if end.is_finite() { end } else { error.value }),
                    }
                })
                .collect(),
            line: line(method, error, x, noise),
            floor: method.floor.filter(|_| method.has_floor && metric == "relMSE").map(|floor| floor.value),
        });
        Plot {
            title: format!("{metric} against {x_label}"),
            x_label: x_label.to_owned(),
            y_label: metric.to_owned(),
            series: series.collect(),
            reference_noise: noise,
        }
    };
    [
        plot("relMSE", relative, seconds, time, scene.truth.rel_mse),
        plot("relMSE", relative, "samples a pixel", samples, scene.truth.rel_mse),
        plot("MSE", plain, seconds, time, scene.truth.mse),
        plot("MSE", plain, "samples a pixel", samples, scene.truth.mse),
    ]
}

/// The least-squares line through what is drawn above the reference's noise, from the first point to the last.
fn line(
    method: &MethodResult,
    error: fn(&Rung) -> Estimate,
    x: fn(&Rung) -> f64,
    reference_noise: f64,
) -> Option<[[f64; 2]; 2]> {
    let points: Vec<[f64; 2]> = method
        .rungs
        .iter()
        .map(|rung| [x(rung), error(rung).value])
        .filter(|point| point[1] > reference_noise)
        .collect();
    let groups: Vec<(f64, Vec<f64>)> = points.iter().map(|[x, y]| (x.ln(), vec![y.ln()])).collect();
    // A floor makes it bend: then the points are joined as they are by their ends alone.
    let end = |point: &[f64; 2]| match crate::converge::Line::fit(&groups, 1.0).filter(|_| !method.has_floor) {
        Some(line) => [point[0], line.at(point[0].ln()).value.exp()],
        None => *point,
    };
    Some([end(points.first()?), end(points.last()?)]).filter(|_| points.len() > 1)
}

/// The reference, and of each method the first picture of the top rung and all its samples' difference from the reference.
fn pictures(record: &Record, scene: &SceneRecord, directory: &Path) -> Result<String, Error> {
    let truth_path = truth_file(directory, &scene.name);
    if !truth_path.exists() {
        return Ok(String::new());
    }
    let truth = read_exr(&truth_path)?.0;
    let mut html = String::from("<div class=\"pictures\">");
    let exposure = record.question.exposure;
    if let Some(beauty) = truth.rgb(plane::BEAUTY) {
        html.push_str(&figure(&truth, &tone_map::to_srgb8(&beauty, exposure), "reference")?);
    }
    for (style, method) in scene.methods.iter().filter(|method| !method.products.is_empty()).enumerate() {
        let Some(top) = method.products.last() else { continue };
        let files = directory_of(directory, &scene.name, &method.name);
        let mut all = Vec::new();
        for run in method.runs.iter().filter(|run| run.spp == top.spp) {
            let file = picture_file(&files, run.spp, run.repetition);
            if file.exists() {
                all.push(read_exr(file)?.0);
            }
        }
        let Some(first) = all.first() else { continue };
        let label = format!("{} {}", key(style), escaped(&method.label));
        // Both in one row.
        html.push_str("<div class=\"pair\">");
        if let Some(beauty) = first.rgb(plane::BEAUTY) {
            html.push_str(&figure(
                first,
                &tone_map::to_srgb8(&beauty, exposure),
                &format!("{label}<br>{} spp", top.spp),
            )?);
        }
        if let Some(mean) = average(&all) {
            let difference = difference_rgb8(&mean, &truth, FULL_COLOR)?;
            let caption = format!("{label}<br>difference of {} × {} spp", all.len(), top.spp);
            html.push_str(&figure(&mean, &difference, &caption)?);
        }
        html.push_str("</div>");
    }
    let full = 100.0 * FULL_COLOR;
    let _ = writeln!(
        html,
        "</div><p class=\"facts\">Differences of luminance, relative: red to yellow is too bright, blue to cyan too dark, full colour at ±{full} %.</p>"
    );
    Ok(html)
}

fn figure(picture: &Picture, rgb: &[u8], caption: &str) -> Result<String, Error> {
    let step = picture.width.div_ceil(THUMBNAIL).max(1);
    let (width, height) = (picture.width / step, picture.height / step);
    let (width, height) = (width.max(1), height.max(1));
    let mut pixels = Vec::with_capacity((width * height * 3) as usize);
    for y in 0..height {
        for x in 0..width {
            for channel in 0..3 {
                let mut sum = 0;
                let mut count = 0;
                for dy in 0..step.min(picture.height - y * step) {
                    for dx in 0..step.min(picture.width - x * step) {
                        let index = ((y * step + dy) * picture.width + x * step + dx) * 3 + channel;
                        sum += u32::from(rgb[index as usize]);
                        count += 1;
                    }
                }
                pixels.push((sum / count.max(1)) as u8);
            }
        }
    }
    let address = png_address(width, height, &pixels)?;
    Ok(format!("<figure><img alt=\"\" src=\"{address}\"><figcaption>{caption}</figcaption></figure>"))
}

/// Every rung.
fn details(scene: &SceneRecord, result: &SceneResult) -> String {
    let mut html = String::from(
        "<details open><summary>Every rung of the ladder</summary><table><thead><tr><th></th><th>method</th><th>spp</th><th>renders</th>\
         <th>seconds</th><th>relMSE</th><th>of it noise</th><th>MSE</th><th>ꟻLIP</th></tr></thead><tbody>\n",
    );
    for (style, method) in result.methods.iter().enumerate() {
        for rung in &method.rungs {
            let mark = if rung.reference_dominates { " †" } else { "" };
            let _ = writeln!(
                html,
                "<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}{mark}</td><td>{}</td><td>{}</td><td>{}</td></tr>",
                key(style),
                escaped(&method.label),
                rung.spp,
                rung.count,
                interval(&rung.seconds),
                interval(&rung.rel_mse),
                rung.noise.map_or("–".into(), |noise| interval(&noise)),
                interval(&rung.mse),
                interval(&rung.flip),
            );
        }
    }
    html.push_str("</tbody></table>");
    if result.methods.iter().flat_map(|method| &method.rungs).any(|rung| rung.reference_dominates) {
        html.push_str("<p class=\"facts\">† More than half of what was measured is noise of the reference: a better one is needed to say more.</p>");
    }
    let odd: Vec<String> = scene
        .methods
        .iter()
        .filter_map(|method| {
            let rejected: u64 = method.runs.iter().map(|run| u64::from(run.rejected_samples)).sum();
            let pixels: usize = method.runs.iter().map(|run| run.non_finite_pixels).sum();
            (rejected > 0 || pixels > 0).then(|| {
                format!("<li>{}: {rejected} samples and {pixels} pixels were not finite</li>", escaped(&method.label))
            })
        })
        .collect();
    if !odd.is_empty() {
        let _ = write!(html, "<div class=\"note\"><b>Not finite</b><ul>{}</ul></div>", odd.join(""));
    }
    html + "</details>\n"
}

/// What the words mean.
fn explanation(record: &Record) -> String {
    let exposure = record.question.exposure;
    format!(
        "<section><h2>How to read it</h2><ul>\
         <li><b>relMSE</b> = mean((x − r)² / (r² + 0.01)), <b>MSE</b> = mean((x − r)²), over pixels and channels, the variance of the reference taken off; \
         <b>ꟻLIP</b> after tone mapping at {exposure:+} stops, the reference’s noise within. Small figures are 95 % confidence intervals by Student’s t over repetitions.</li>\
         <li><b>of it noise</b>: the spread of repetitions about each other, which needs no reference. Slope, efficiency and times are of it.</li>\
         <li><b>slope</b>: d ln noise / d ln spp; −1 for independent samples. <b>efficiency</b>: 1 / (noise · seconds) at the top of the ladder, relative to the first method.</li>\
         <li><b>s to relMSE</b>: floor and noise together; <i>in italics</i> beyond what was rendered; “never” below the floor.</li>\
         <li><b>biased?</b>: all samples of a method as one picture against the reference, by blocks of pixels, as small as the noise allows, and by the mean, corrected (Šidák) for all tests of the study; p &lt; {SIGNIFICANCE} counts.</li>\
         <li><b>error floor</b>: what is left of the relMSE when noise is gone: the error of the material’s model; said if it is beyond chance at 99 %.</li>\
         </ul><p class=\"facts\">Formulas and sources: docs/convergence.md.</p></section>\n"
    )
}

const STYLE: &str = "\
body{font:14px/1.45 system-ui,sans-serif;color:#111;background:#fff;max-width:1120px;margin:24px auto;padding:0 16px}\
h1{font-size:22px;margin:0 0 4px}h2{font-size:18px;margin:28px 0 2px;border-top:1px solid #ccc;padding-top:14px}\
.facts{color:#555;font-size:12.5px;margin:4px 0 10px}.note{border-left:3px solid #E69F00;padding:2px 12px;margin:10px 0}.note ul{margin:4px 0}\
table{border-collapse:collapse;margin:8px 0;font-size:13px;width:100%}th,td{text-align:left;padding:3px 8px;border-bottom:1px solid #e4e4e4;vertical-align:top}\
th{font-weight:600;border-bottom:1px solid #999}td small{color:#666;white-space:nowrap}.key{vertical-align:middle}\
.bad{color:#b00020}.good{color:#111}\
.plots{display:grid;grid-template-columns:1fr 1fr;gap:10px}.plots svg{width:100%;height:auto}\
.pair{display:flex;gap:4px}.pictures{display:flex;flex-wrap:wrap;gap:10px;margin-top:10px}figure{margin:0;width:172px}figure img{width:172px;image-rendering:pixelated;display:block}\
figcaption{font-size:12px;color:#333}summary{cursor:pointer;margin-top:10px;font-weight:600}\
@media print{body{margin:0;max-width:none}section,figure,svg{break-inside:avoid}}\
@media(max-width:760px){.plots{grid-template-columns:1fr}}";
