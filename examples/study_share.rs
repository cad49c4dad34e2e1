//! `make study-share`: what sharing codebooks costs, and what it saves.
//!
//! The published networks, as many of them as are asked for, MERL's first, are put into groups of 1, 2, 4 … that share a
//! codebook a hemisphere: at random, and by how alike they are. Each group leaves a JSON file in the folder; what is there is not
//! done again. Prints a table in Markdown and draws it.

mod study;

use std::fmt::Write;
use std::path::PathBuf;

use anyhow::{Result, bail};
use clap::Parser;
use neubrdf::converge::Stopwatch;
use neubrdf::image::write_file;
use neubrdf::scene::brdf::{NeuBrdfPack, Precision};
use neubrdf::train::{Evaluator, GroundTruth, Group, Model, Plan, Quality, Recipe, Session, cluster};
use serde::{Deserialize, Serialize};
use study::{Errors, Truth, bar, errors, kept, key, published};

/// Fit groups of materials that share codebooks.
#[derive(Parser)]
struct Arguments {
    /// How many materials: the first so many by name
    #[arg(long, default_value_t = 64)]
    count: usize,
    /// Sizes of groups
    #[arg(long, value_delimiter = ',', default_values_t = [1, 2, 4, 8, 16, 32, 64])]
    sizes: Vec<usize>,
    /// Steps of each material
    #[arg(long, default_value_t = 1500)]
    steps: u32,
    /// Codes of a hemisphere
    #[arg(long, default_value_t = 1024)]
    codes: usize,
    /// Resolutions of the grids
    #[arg(long, default_value_t = 3)]
    resolutions: usize,
    /// Features of a code
    #[arg(long, default_value_t = 4)]
    features: usize,
    /// Share the networks as well
    #[arg(long)]
    share_network: bool,
    /// Where results and the plot are kept
    #[arg(long, default_value = "target/study-share")]
    folder: PathBuf,
    /// Fit nothing: print and draw the sizes of which all groups are there
    #[arg(long)]
    print: bool,
}

/// What a group came to.
#[derive(Clone, Serialize, Deserialize)]
struct Outcome {
    errors: Vec<Errors>,
    bytes: usize,
    cpu_seconds: f64,
}

/// What all groups of a size came to.
struct Row {
    size: usize,
    is_clustered: bool,
    outcomes: Vec<Outcome>,
}

fn main() -> Result<()> {
    let arguments = Arguments::parse();
    std::fs::create_dir_all(&arguments.folder)?;
    let mut truths = published()?;
    truths.truncate(arguments.count);
    if truths.is_empty() {
        bail!("no published networks in ../shared/data/nbrdf");
    }
    let watch = Stopwatch::own();
    let features: Vec<Vec<f64>> = truths.iter().map(|truth| cluster::features(&|wo, wi| truth.eval(wo, wi))).collect();
    let clustered = |size: usize| cluster::groups(&features, truths.len().div_ceil(size), size);
    clustered(8);
    eprintln!("features and groups of 8: {:.2} CPU s", watch.stop().cpu_seconds);
    let order = cluster::shuffled(truths.len());
    let mut plans = Vec::new();
    for &size in &arguments.sizes {
        let random: Vec<Vec<usize>> = order.chunks(size).map(<[usize]>::to_vec).collect();
        plans.push((size, false, random));
        if size > 1 && size < truths.len() {
            plans.push((size, true, clustered(size)));
        }
    }
    let bar = bar(plans.iter().map(|(.., groups)| groups.len()).sum())?;
    let mut rows = Vec::new();
    for (size, is_clustered, groups) in plans {
        let mut outcomes = Vec::new();
        for group in &groups {
            let members: Vec<&Truth> = group.iter().map(|member| &truths[*member]).collect();
            bar.set_message(format!("{size}: {}", members[0].name));
            outcomes.extend(outcome(&arguments, &members)?);
            bar.inc(1);
        }
        if outcomes.len() == groups.len() {
            rows.push(Row { size, is_clustered, outcomes });
        }
    }
    bar.finish_and_clear();
    print_table(&rows);
    write_file(arguments.folder.join("sharing.svg"), plot(&rows))?;
    Ok(())
}

/// What is known of a group, or is found out now.
fn outcome(arguments: &Arguments, members: &[&Truth]) -> Result<Option<Outcome>> {
    let plan = Plan::new(Model::NeuBrdf, Recipe::Default, Quality::Draft, true);
    let Arguments { steps, resolutions, features, .. } = *arguments;
    let plan = Plan { steps, pairs: 1 << 17, resolutions, features, ..plan };
    let plan = if arguments.share_network { plan.wide() } else { plan };
    let plan = if members.len() == 1 { plan } else { plan.for_group(members.len(), Some(arguments.codes)) };
    let names: Vec<&str> = members.iter().map(|truth| truth.name.as_str()).collect();
    let path =
        arguments.folder.join(format!("{}-{}.json", members.len(), key(&(&plan, &names, arguments.share_network))?));
    if arguments.print && !path.exists() {
        return Ok(None);
    }
    kept(&path, || {
        let session = |truth: &&Truth| {
            let pairs = truth.pairs(plan.pairs, plan.seed);
            Ok(Session::new(plan.clone(), &GroundTruth::Samples { pairs: &pairs, is_isotropic: true })?)
        };
        let mut sessions = members.iter().map(session).collect::<Result<Vec<_>>>()?;
        let watch = Stopwatch::own();
        let materials = if let [session] = sessions.as_mut_slice() {
            session.run(u32::MAX);
            session.neubrdf().into_iter().collect()
        } else {
            let mut group = Group::new(sessions, arguments.share_network)?;
            group.run(u32::MAX);
            group.neubrdfs()
        };
        let cpu_seconds = watch.stop().cpu_seconds;
        let named = names.iter().map(|name| (*name).to_owned()).zip(materials).collect();
        let bytes = NeuBrdfPack { materials: named }.encode(Precision::F16)?;
        let fits = NeuBrdfPack::decode(&bytes)?.materials;
        let errors =
            members.iter().zip(&fits).map(|(truth, (_, fit))| errors(truth, &Evaluator::neubrdf(fit))).collect();
        Ok(Outcome { errors, bytes: bytes.len(), cpu_seconds })
    })
    .map(Some)
}

impl Row {
    fn errors(&self) -> impl Iterator<Item = &Errors> {
        self.outcomes.iter().flat_map(|outcome| &outcome.errors)
    }

    fn mean(&self, of: impl Fn(&Errors) -> f64) -> f64 {
        self.errors().map(of).sum::<f64>() / self.errors().count() as f64
    }

    fn bytes(&self) -> f64 {
        self.outcomes.iter().map(|outcome| outcome.bytes as f64).sum::<f64>() / self.errors().count() as f64
    }

    fn cpu_seconds(&self) -> f64 {
        self.outcomes.iter().map(|outcome| outcome.cpu_seconds).sum::<f64>() / self.errors().count() as f64
    }
}

fn print_table(rows: &[Row]) {
    println!(
        "| materials a codebook | groups | mean \\|Δ ln(1+f)\\| | worst | SSIM | worst | bytes a material | CPU s a material |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for row in rows {
        let groups = match row.size {
            1 => "—",
            _ if row.is_clustered => "alike",
            _ => "random",
        };
        let worst_log = row.errors().map(|errors| errors.log).fold(0.0, f64::max);
        let worst_ssim = row.errors().map(|errors| errors.ssim).fold(1.0, f64::min);
        println!(
            "| {} | {groups} | {:.4} | {worst_log:.4} | {:.4} | {worst_ssim:.4} | {:.0} | {:.1} |",
            row.size,
            row.mean(|errors| errors.log),
            row.mean(|errors| errors.ssim),
            row.bytes(),
            row.cpu_seconds()
        );
    }
}

/// Error and bytes against the size of groups, beside one another; both axes are logarithmic.
fn plot(rows: &[Row]) -> String {
    let mut svg = String::from(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 760 300\" font-family=\"sans-serif\" font-size=\"12\">\n<rect width=\"760\" height=\"300\" fill=\"white\"/>\n",
    );
    panel(&mut svg, 0.0, "mean |Δ ln(1 + f)|", rows, &|row| row.mean(|errors| errors.log));
    panel(&mut svg, 380.0, "bytes a material", rows, &Row::bytes);
    svg + "</svg>\n"
}

fn panel(svg: &mut String, left: f64, label: &str, rows: &[Row], value: &dyn Fn(&Row) -> f64) {
    let (x_0, y_0, width, height) = (left + 62.0, 250.0, 290.0, 210.0);
    let most_size = rows.iter().map(|row| row.size).max().unwrap_or(2).max(2) as f64;
    let (low, high) = rows.iter().map(value).fold((f64::MAX, 0.0f64), |(low, high), y| (low.min(y), high.max(y)));
    let (low, high) = (0.9 * low, 1.1 * high);
    let x = |size: usize| x_0 + width * (size as f64).log2() / most_size.log2();
    let y = |value: f64| y_0 - height * (value / low).ln() / (high / low).ln();
    let _ = writeln!(svg, "<text x=\"{x_0}\" y=\"24\" font-weight=\"bold\">{label}</text>");
    let _ = writeln!(svg, "<path d=\"M{x_0} {}V{y_0}H{}\" stroke=\"#444\" fill=\"none\"/>", y_0 - height, x_0 + width);
    for size in rows.iter().filter(|row| !row.is_clustered).map(|row| row.size) {
        let _ = writeln!(svg, "<text x=\"{:.1}\" y=\"{}\" text-anchor=\"middle\">{size}</text>", x(size), y_0 + 16.0);
    }
    for share in [0.0, 0.25, 0.5, 0.75, 1.0] {
        let at = low * (high / low).powf(share);
        let text = if at < 1.0 { format!("{at:.4}") } else { format!("{at:.0}") };
        let _ = writeln!(svg, "<text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{text}</text>", x_0 - 6.0, y(at) + 4.0);
    }
    let _ = writeln!(
        svg,
        "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">materials that share a codebook</text>",
        x_0 + width / 2.0,
        y_0 + 36.0
    );
    for (index, (is_clustered, name, color, dash)) in
        [(false, "random groups", "#D55E00", "5 3"), (true, "groups of what is alike", "#0072B2", "none")]
            .into_iter()
            .enumerate()
    {
        // Both begin where nothing is shared and end where all is.
        let is_end = |row: &Row| !rows.iter().any(|other| other.is_clustered && other.size == row.size);
        let points: Vec<(f64, f64)> = rows
            .iter()
            .filter(|row| row.is_clustered == is_clustered || is_end(row))
            .map(|row| (x(row.size), y(value(row))))
            .collect();
        let path: Vec<String> = points.iter().map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
        let _ = writeln!(
            svg,
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"2\" stroke-dasharray=\"{dash}\"/>",
            path.join(" ")
        );
        for (x, y) in points {
            let _ = writeln!(svg, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3\" fill=\"{color}\"/>");
        }
        let _ = writeln!(
            svg,
            "<text x=\"{}\" y=\"{}\" text-anchor=\"end\" fill=\"{color}\">{name}</text>",
            x_0 + width,
            24.0 + 15.0 * index as f64
        );
    }
}
