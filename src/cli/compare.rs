//! `neubrdf compare`.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Result, bail};
use neubrdf::converge::{Comparison, Error, difference, write_difference_png};
use neubrdf::image::{Metadata, read_exr, write_exr};

use super::job::{check_ending, check_outputs, exposure, threshold};

/// Say how two pictures differ. Exit status 3 if a threshold is exceeded.
#[derive(clap::Args)]
pub struct Arguments {
    /// The picture
    picture: PathBuf,
    /// What it should look like
    reference: PathBuf,
    /// Write the difference: signed in an .exr, relative in false colour in a .png (full colour at ±10 %)
    #[arg(short, long, value_name = "EXR|PNG")]
    output: Option<PathBuf>,
    /// Exposure of the FLIP comparison, in stops
    #[arg(long, value_name = "STOPS", default_value_t = 0.0, allow_negative_numbers = true, value_parser = exposure)]
    exposure: f32,
    /// Fail if the MSE is above
    #[arg(long, value_parser = threshold)]
    max_mse: Option<f64>,
    /// Fail if the relMSE, mean((x−r)²/(r²+0.01)), is above
    #[arg(long, value_parser = threshold)]
    max_rel_mse: Option<f64>,
    /// Fail if the mean FLIP error is above
    #[arg(long, value_parser = threshold)]
    max_flip: Option<f64>,
    /// Fail if the z-test's p-value is below: the difference is not noise
    #[arg(long, value_parser = threshold)]
    min_p: Option<f64>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// A threshold was exceeded.
const EXCEEDED: u8 = 3;

/// Reads both, compares, prints.
pub fn run(arguments: Arguments) -> Result<ExitCode> {
    if let Some(path) = &arguments.output {
        check_ending(path, &["exr", "png"])?;
        check_outputs([path.as_path()], [arguments.picture.as_path(), arguments.reference.as_path()])?;
    }
    let (picture, of_picture) = read_exr(&arguments.picture)?;
    let (reference, of_reference) = read_exr(&arguments.reference)?;
    let [image_origin, reference_origin] = [of_picture, of_reference].map(|metadata| metadata.crop_origin);
    if image_origin != reference_origin {
        return Err(Error::PlaceMismatch { image: image_origin, reference: reference_origin }.into());
    }
    let comparison = Comparison::of(&picture, &reference, arguments.exposure)?;
    if arguments.json {
        tell!("{:#}", comparison.to_json())?;
    } else {
        tell!("{comparison}")?;
    }
    if let Some(path) = &arguments.output {
        match path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("exr")) {
            true => write_exr(path, &difference(&picture, &reference)?, &Metadata::default())?,
            false => write_difference_png(path, &picture, &reference, 0.1)?,
        }
    }
    let metrics = &comparison.metrics;
    let mut exceeded = false;
    for (name, found, most) in [
        ("MSE", metrics.mse, arguments.max_mse),
        ("relMSE", metrics.rel_mse, arguments.max_rel_mse),
        ("FLIP", metrics.flip, arguments.max_flip),
    ] {
        // A NaN is above every threshold.
        if let Some(most) = most.filter(|most| found > *most || found.is_nan()) {
            note!("{name} is {found:.6e}, above {most:e}");
            exceeded = true;
        }
    }
    if let Some(least) = arguments.min_p {
        let Some(test) = &comparison.z_test else {
            bail!("--min-p needs variance and sample counts of both pictures, and two samples a pixel of one");
        };
        if test.p < least || test.p.is_nan() {
            note!("the z-test's p is {:.3e}, below {least:e}", test.p);
            exceeded = true;
        }
    }
    Ok(if exceeded { ExitCode::from(EXCEEDED) } else { ExitCode::SUCCESS })
}
