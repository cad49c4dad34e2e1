//! Plots as SVG: lobes in the plane of incidence, and lines.

use std::f64::consts::FRAC_PI_2;
use std::fmt::Write;

use glam::DVec3;

use super::measure::Eval;

/// Colours of the slices of a [`polar`] plot.
const COLORS: [&str; 4] = ["#0b6e99", "#c2410c", "#15803d", "#7e22ce"];

/// θi of the slices, degrees.
const THETAS: [f64; 4] = [0.0, 30.0, 55.0, 75.0];

/// Lobes in the plane of incidence (and of the tangent): for a few θi, ln(1 + gain · f cos θo) by the angle of ωo, mean over
/// channels; the first BRDF solid, others dashed. Radii are relative to the largest.
pub fn polar(gain: f64, brdfs: &[Eval]) -> String {
    const STEPS: usize = 720;
    let at = |angle: f64| DVec3::new(angle.sin(), 0.0, angle.cos());
    let angles: Vec<f64> = (1..STEPS).map(|step| FRAC_PI_2 * (2.0 * step as f64 / STEPS as f64 - 1.0)).collect();
    let curve = |brdf: &Eval, theta: f64| -> Vec<f64> {
        let pairs: Vec<[DVec3; 2]> = angles.iter().map(|angle| [at(*angle), at(-theta.to_radians())]).collect();
        let radius = |(value, [wo, _]): (DVec3, &[DVec3; 2])| (gain * value.element_sum() / 3.0 * wo.z).ln_1p();
        brdf(&pairs).into_iter().zip(&pairs).map(radius).collect()
    };
    let curves: Vec<(usize, usize, Vec<f64>)> = (0..THETAS.len())
        .flat_map(|slice| (0..brdfs.len()).map(move |which| (slice, which)))
        .map(|(slice, which)| (slice, which, curve(&brdfs[which], THETAS[slice])))
        .collect();
    let largest = curves.iter().flat_map(|(.., radii)| radii).copied().fold(1e-9, f64::max);

    let mut svg = String::from(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"-320 -310 640 350\" font-family=\"sans-serif\" font-size=\"11\">\n",
    );
    for part in 1..=3 {
        let radius = 100 * part;
        let _ = writeln!(
            svg,
            "<path d=\"M-{radius} 0A{radius} {radius} 0 0 1 {radius} 0\" fill=\"none\" stroke=\"#ddd\"/>"
        );
    }
    for degrees in [-60, -30, 0, 30, 60] {
        let (sin, cos) = f64::from(degrees).to_radians().sin_cos();
        let _ = writeln!(svg, "<path d=\"M0 0L{:.1} {:.1}\" stroke=\"#eee\"/>", 300.0 * sin, -300.0 * cos);
    }
    svg.push_str("<path d=\"M-310 0H310\" stroke=\"#999\"/>\n");
    for (slice, which, radii) in curves {
        let points: Vec<String> = angles
            .iter()
            .zip(radii)
            .map(|(angle, radius)| {
                let radius = 300.0 * radius / largest;
                format!("{:.1},{:.1}", radius * angle.sin(), -radius * angle.cos())
            })
            .collect();
        let dash = if which == 0 { "" } else { " stroke-dasharray=\"5 3\"" };
        let _ = writeln!(
            svg,
            "<polyline fill=\"none\" stroke=\"{}\" stroke-width=\"1.4\"{dash} points=\"{}\"/>",
            COLORS[slice],
            points.join(" ")
        );
    }
    for (slice, theta) in THETAS.iter().enumerate() {
        let _ = writeln!(
            svg,
            "<text x=\"{}\" y=\"28\" fill=\"{}\">θi = {theta}°</text>",
            -300 + 110 * slice as i32,
            COLORS[slice]
        );
    }
    svg + "</svg>\n"
}

/// A line of values over an axis, both linear; `x` and `y` say what they are.
pub fn line(x: &str, y: &str, points: &[[f64; 2]]) -> String {
    let bounds = |axis: usize| {
        points.iter().map(|point| point[axis]).fold((0.0f64, 1e-12f64), |(low, high), v| (low.min(v), high.max(v)))
    };
    let ((left, right), (low, high)) = (bounds(0), bounds(1));
    let place =
        |[x, y]: [f64; 2]| [60.0 + 480.0 * (x - left) / (right - left), 190.0 - 170.0 * (y - low) / (high - low)];
    let mut svg = String::from(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 560 230\" font-family=\"sans-serif\" font-size=\"11\">\n",
    );
    let _ = writeln!(svg, "<path d=\"M60 20V190H540\" fill=\"none\" stroke=\"#999\"/>");
    let _ =
        writeln!(svg, "<text x=\"300\" y=\"222\" text-anchor=\"middle\">{x}</text><text x=\"60\" y=\"12\">{y}</text>");
    for (value, anchor) in [(left, "start"), (right, "end")] {
        let [x, _] = place([value, low]);
        let _ = writeln!(svg, "<text x=\"{x:.1}\" y=\"205\" text-anchor=\"{anchor}\">{value:.0}</text>");
    }
    for value in [low, high] {
        let [_, y] = place([left, value]);
        let _ = writeln!(svg, "<text x=\"55\" y=\"{:.1}\" text-anchor=\"end\">{value:.2e}</text>", y + 4.0);
    }
    let places: Vec<String> = points.iter().map(|point| place(*point)).map(|[x, y]| format!("{x:.1},{y:.1}")).collect();
    let _ = writeln!(
        svg,
        "<polyline fill=\"none\" stroke=\"{}\" stroke-width=\"1.6\" points=\"{}\"/>",
        COLORS[0],
        places.join(" ")
    );
    svg + "</svg>\n"
}
