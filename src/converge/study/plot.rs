//! Log-log plots as SVG, readable in print and by the colour-blind: each series has a colour (Okabe and Ito 2008), a marker and a
//! dash of its own.

use std::fmt::Write;

use crate::image::escaped;

/// A point with the interval of its ordinate.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    /// > 0.
    pub x: f64,
    /// Left out unless > 0.
    pub y: f64,
    /// Lower and upper end of the bar.
    pub interval: [f64; 2],
}

/// Points of one method, and the line fitted to them.
pub struct Series {
    /// Its place among all: picks colour, marker and dash.
    pub style: usize,
    /// What a pointer sees over it.
    pub title: String,
    /// From left to right.
    pub points: Vec<Point>,
    /// Two ends of the fitted line.
    pub line: Option<[[f64; 2]; 2]>,
    /// A level that the curve does not sink below.
    pub floor: Option<f64>,
}

/// A plot.
pub struct Plot {
    /// Above it.
    pub title: String,
    /// Of the abscissa.
    pub x_label: String,
    /// Of the ordinate.
    pub y_label: String,
    /// What is drawn.
    pub series: Vec<Series>,
    /// The noise of the reference.
    pub reference_noise: f64,
}

const WIDTH: f64 = 520.0;
const HEIGHT: f64 = 360.0;
const LEFT: f64 = 66.0;
const RIGHT: f64 = 14.0;
const TOP: f64 = 28.0;
const BOTTOM: f64 = 46.0;
const MARKER: f64 = 4.5;
/// From one line of a legend to the next.
const LINE: f64 = 17.0;

/// How the parts of a plot look, as CSS.
pub const STYLE: &str = "\
svg text{font:11px system-ui,sans-serif;fill:#222}svg .title{font-weight:600;font-size:12.5px}svg .tick{fill:#444}\
svg .minor{stroke:#eee;fill:none}svg .major{stroke:#d4d4d4;fill:none}svg .frame{stroke:#666;fill:none}svg .shade{fill:#000;opacity:.06}";

const COLORS: [&str; 7] = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000"];
const DASHES: [&str; 6] = ["", "7 3", "2 3", "9 3 2 3", "12 4", "2 2 6 2"];

/// The colour of a series.
pub fn color(style: usize) -> &'static str {
    COLORS[style % COLORS.len()]
}

/// A sample of a series' line and marker, for tables.
pub fn key(style: usize) -> String {
    let mut svg =
        String::from("<svg class=\"key\" width=\"46\" height=\"14\" viewBox=\"0 0 46 14\" aria-hidden=\"true\">");
    svg.push_str(&stroke([2.0, 7.0], [44.0, 7.0], style));
    svg.push_str(&marker(style, 23.0, 7.0));
    svg + "</svg>"
}

/// Logarithmic axis.
struct Axis {
    low: f64,
    high: f64,
    from: f64,
    to: f64,
}

impl Axis {
    fn new(values: impl Iterator<Item = f64> + Clone, from: f64, to: f64) -> Axis {
        let positive = values.filter(|value| value.is_finite() && *value > 0.0).map(f64::log10);
        let (low, high) = (positive.clone().fold(f64::INFINITY, f64::min), positive.fold(f64::NEG_INFINITY, f64::max));
        let (low, high) = if low > high { (0.0, 1.0) } else { (low, high) };
        let margin = 0.06 * (high - low).max(0.5);
        Axis { low: low - margin, high: high + margin, from, to }
    }

    fn place(&self, value: f64) -> f64 {
        let part = (value.max(1e-300).log10() - self.low) / (self.high - self.low);
        self.from + part.clamp(-0.02, 1.02) * (self.to - self.from)
    }

    /// Values to draw a line at, and whether to write them.
    fn ticks(&self) -> Vec<(f64, bool)> {
        let decades = self.high - self.low;
        let written = |digit: u32| match decades {
            ..0.9 => matches!(digit, 1..=6),
            ..2.2 => matches!(digit, 1 | 2 | 5),
            _ => digit == 1,
        };
        let decade = (self.low.floor() as i32)..=(self.high.ceil() as i32);
        decade
            .flat_map(|exponent| (1..10).map(move |digit| (f64::from(digit) * 10f64.powi(exponent), digit)))
            .filter(|(value, _)| (self.low..=self.high).contains(&value.log10()))
            .map(|(value, digit)| (value, written(digit)))
            .collect()
    }
}

impl Plot {
    /// The plot as an SVG element, to stand in a page that has [`STYLE`].
    pub fn svg(&self) -> String {
        let title = escaped(&self.title);
        format!(
            "<svg viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" aria-label=\"{title}\"><title>{title}</title>{}</svg>",
            self.inside()
        )
    }

    /// The plot as a file of its own, with a legend of all series that have points.
    pub fn document(&self) -> String {
        let named: Vec<&Series> = self.series.iter().filter(|series| !series.points.is_empty()).collect();
        let height = HEIGHT + LINE * named.len().div_ceil(2) as f64 + 6.0;
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height}\" width=\"{}\">\n<style>{STYLE}</style>\n\
             <rect width=\"{WIDTH}\" height=\"{height}\" fill=\"#fff\"/>\n{}\n",
            1.5 * WIDTH,
            self.inside()
        );
        for (place, series) in named.into_iter().enumerate() {
            let x = LEFT + (WIDTH - LEFT) / 2.0 * (place % 2) as f64;
            let y = HEIGHT + LINE * (place / 2) as f64;
            let _ = writeln!(
                svg,
                "{}<text x=\"{:.1}\" y=\"{:.1}\">{}</text>",
                marker(series.style, x, y),
                x + 12.0,
                y + 4.0,
                escaped(&series.title)
            );
        }
        svg + "</svg>\n"
    }

    fn inside(&self) -> String {
        let points = || self.series.iter().flat_map(|series| &series.points).filter(|point| point.y > 0.0);
        let x = Axis::new(points().map(|point| point.x), LEFT, WIDTH - RIGHT);
        // Bars may reach down to nothing; the axis need not.
        let ends =
            |point: &Point| [point.y, point.interval[0].max(point.y / 3.0), point.interval[1].min(point.y * 3.0)];
        let floors = || self.series.iter().filter_map(|series| series.floor);
        let values: Vec<f64> = points().flat_map(ends).chain(floors()).collect();
        let y = Axis::new(values.iter().copied(), HEIGHT - BOTTOM, TOP);

        let mut svg = String::new();
        let _ = write!(svg, "<text class=\"title\" x=\"{LEFT}\" y=\"16\">{}</text>", escaped(&self.title));
        self.draw_axes(&mut svg, &x, &y);
        // Where what is measured is mostly the reference's own noise.
        if self.reference_noise > 0.0 && self.reference_noise.log10() > y.low {
            let top = y.place(self.reference_noise);
            let height = HEIGHT - BOTTOM - top;
            let _ = write!(
                svg,
                "<rect class=\"shade\" x=\"{LEFT}\" y=\"{top:.1}\" width=\"{:.1}\" height=\"{:.1}\"><title>below the noise of the reference</title></rect><text class=\"tick\" x=\"{:.1}\" y=\"{:.1}\">below the reference’s own noise</text>",
                WIDTH - RIGHT - LEFT,
                height.max(0.0),
                LEFT + 6.0,
                top + 12.0
            );
        }
        for series in &self.series {
            draw(&mut svg, series, &x, &y);
        }
        svg
    }

    fn draw_axes(&self, svg: &mut String, x: &Axis, y: &Axis) {
        let (right, bottom) = (WIDTH - RIGHT, HEIGHT - BOTTOM);
        for (value, is_written) in x.ticks() {
            let place = x.place(value);
            let class = if is_written { "major" } else { "minor" };
            let _ = write!(svg, "<path class=\"{class}\" d=\"M{place:.1} {TOP}V{bottom}\"/>");
            if is_written {
                let _ = write!(
                    svg,
                    "<text class=\"tick\" text-anchor=\"middle\" x=\"{place:.1}\" y=\"{}\">{}</text>",
                    bottom + 15.0,
                    plain(value)
                );
            }
        }
        for (value, is_written) in y.ticks() {
            let place = y.place(value);
            let class = if is_written { "major" } else { "minor" };
            let _ = write!(svg, "<path class=\"{class}\" d=\"M{LEFT} {place:.1}H{right}\"/>");
            if is_written {
                let _ = write!(
                    svg,
                    "<text class=\"tick\" text-anchor=\"end\" x=\"{}\" y=\"{:.1}\">{}</text>",
                    LEFT - 6.0,
                    place + 3.5,
                    plain(value)
                );
            }
        }
        let _ = write!(svg, "<path class=\"frame\" d=\"M{LEFT} {TOP}H{right}V{bottom}H{LEFT}Z\"/>");
        let _ = write!(
            svg,
            "<text class=\"label\" text-anchor=\"middle\" x=\"{:.1}\" y=\"{}\">{}</text>",
            (LEFT + right) / 2.0,
            HEIGHT - 10.0,
            escaped(&self.x_label)
        );
        let middle = (TOP + bottom) / 2.0;
        let _ = write!(
            svg,
            "<text class=\"label\" text-anchor=\"middle\" transform=\"translate(14 {middle:.1}) rotate(-90)\">{}</text>",
            escaped(&self.y_label)
        );
    }
}

fn draw(svg: &mut String, series: &Series, x: &Axis, y: &Axis) {
    let _ = write!(svg, "<g><title>{}</title>", escaped(&series.title));
    if let Some([[x0, y0], [x1, y1]]) = series.line {
        svg.push_str(&stroke([x.place(x0), y.place(y0)], [x.place(x1), y.place(y1)], series.style));
    }
    if let Some(floor) = series.floor {
        let place = y.place(floor);
        let _ = write!(
            svg,
            "<path fill=\"none\" stroke=\"{}\" stroke-width=\"1\" stroke-dasharray=\"1 3\" d=\"M{LEFT} {place:.1}H{}\"/>",
            color(series.style),
            WIDTH - RIGHT
        );
    }
    for point in series.points.iter().filter(|point| point.y > 0.0) {
        let (place_x, place_y) = (x.place(point.x), y.place(point.y));
        let [low, high] = point.interval.map(|end| y.place(end));
        let _ = write!(
            svg,
            "<path stroke=\"{}\" stroke-width=\"1\" d=\"M{place_x:.1} {low:.1}V{high:.1}\"/>{}",
            color(series.style),
            marker(series.style, place_x, place_y)
        );
    }
    svg.push_str("</g>");
}

fn stroke([x0, y0]: [f64; 2], [x1, y1]: [f64; 2], style: usize) -> String {
    format!(
        "<path fill=\"none\" stroke=\"{}\" stroke-width=\"1.6\" stroke-dasharray=\"{}\" d=\"M{x0:.1} {y0:.1}L{x1:.1} {y1:.1}\"/>",
        color(style),
        DASHES[style % DASHES.len()]
    )
}

/// Every second round of shapes is hollow.
fn marker(style: usize, x: f64, y: f64) -> String {
    let polygon = |corners: &[[f64; 2]]| {
        let corners: Vec<String> =
            corners.iter().map(|[dx, dy]| format!("{:.1},{:.1}", x + dx * MARKER, y + dy * MARKER)).collect();
        format!("polygon points=\"{}\"", corners.join(" "))
    };
    let shape = match style % 5 {
        0 => format!("circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{:.1}\"", MARKER * 0.9),
        1 => polygon(&[[-0.85, -0.85], [0.85, -0.85], [0.85, 0.85], [-0.85, 0.85]]),
        2 => polygon(&[[0.0, -1.1], [1.0, 0.75], [-1.0, 0.75]]),
        3 => polygon(&[[0.0, -1.2], [1.2, 0.0], [0.0, 1.2], [-1.2, 0.0]]),
        _ => polygon(&[[0.0, 1.1], [1.0, -0.75], [-1.0, -0.75]]),
    };
    let fill = if (style / 5).is_multiple_of(2) { color(style) } else { "#fff" };
    format!("<{shape} fill=\"{fill}\" stroke=\"{}\" stroke-width=\"1.3\"/>", color(style))
}

/// A number as short as it is clear.
pub fn plain(value: f64) -> String {
    match value {
        0.0 => return "0".into(),
        ..0.0 => return format!("−{}", plain(-value)),
        _ => {}
    }
    let exponent = value.abs().log10().floor() as i32;
    match exponent {
        -3..=-1 => format!("{:.*}", (2 - exponent) as usize, value).trim_end_matches('0').to_owned(),
        0..=4 => {
            let text = format!("{value:.2}");
            text.trim_end_matches('0').trim_end_matches('.').to_owned()
        }
        _ => {
            let mantissa = format!("{:.2}", value / 10f64.powi(exponent));
            let mantissa = mantissa.trim_end_matches('0').trim_end_matches('.');
            let raised: String = exponent.to_string().chars().map(superscript).collect();
            match mantissa {
                "1" => format!("10{raised}"),
                _ => format!("{mantissa}·10{raised}"),
            }
        }
    }
}

fn superscript(char: char) -> char {
    match char {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        digit => digit.to_digit(10).and_then(|digit| char::from_u32(0x2070 + digit)).unwrap_or(digit),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short_and_right() {
        for (value, text) in [
            (0.001, "0.001"),
            (0.01234, "0.0123"),
            (1.0, "1"),
            (64.0, "64"),
            (1.5e-4, "1.5·10⁻⁴"),
            (1e-10, "10⁻¹⁰"),
            (-1.02, "−1.02"),
            (1e6, "10⁶"),
            (0.0, "0"),
        ] {
            assert_eq!(plain(value), text);
        }
    }

    #[test]
    fn a_plot_holds_every_series_and_nothing_beyond_its_frame() {
        let series = |style| Series {
            style,
            title: "a < b".into(),
            points: vec![
                Point { x: 1.0, y: 0.1, interval: [0.05, 0.2] },
                Point { x: 10.0, y: -1.0, interval: [-2.0, 0.0] },
                Point { x: 100.0, y: 0.001, interval: [-1.0, 0.002] },
            ],
            line: Some([[1.0, 0.1], [100.0, 0.001]]),
            floor: None,
        };
        let plot = Plot {
            title: "relMSE".into(),
            x_label: "seconds".into(),
            y_label: "relMSE".into(),
            series: (0..12).map(series).collect(),
            reference_noise: 1e-2,
        };
        let svg = plot.svg();
        assert_eq!(svg.matches("a &lt; b").count(), 12);
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
        let file = plot.document();
        assert_eq!(file.matches("a &lt; b</text>").count(), 12);
        // No two of the first ten methods look alike without colour.
        let looks: std::collections::BTreeSet<String> =
            (0..10).map(|style| key(style).replace(color(style), "colour")).collect();
        assert_eq!(looks.len(), 10);
    }
}
