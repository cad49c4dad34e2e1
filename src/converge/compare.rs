//! A picture against its reference: all figures, as text, JSON and pictures.

use std::fmt;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::metrics::beauties;
use super::{Error, Metrics, ZTest};
use crate::image::{self, Metadata, Picture, plane};

/// All that can be said about two pictures.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// How far apart they are.
    pub metrics: Metrics,
    /// Whether that is chance; `None` where a picture has no variance or no sample counts, or both have but one sample.
    pub z_test: Option<ZTest>,
}

impl Comparison {
    /// Compares, by blocks that suit the noise; `flip_exposure` in stops.
    pub fn of(image: &Picture, reference: &Picture, flip_exposure: f32) -> Result<Comparison, Error> {
        Ok(Comparison {
            width: image.width,
            height: image.height,
            metrics: Metrics::of(image, reference, flip_exposure)?,
            z_test: match ZTest::for_noise(image, reference) {
                Ok(test) => Some(test),
                Err(Error::MissingPlane { .. } | Error::TooFewSamples { .. }) => None,
                Err(error) => return Err(error),
            },
        })
    }

    /// The figures as JSON; numbers that JSON cannot write (NaN, ∞) are `null`.
    pub fn to_json(&self) -> serde_json::Value {
        serde_json::json!(self)
    }
}

impl fmt::Display for Comparison {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        let metrics = &self.metrics;
        let [red, green, blue] = metrics.bias;
        writeln!(out, "pixels            {}×{}", self.width, self.height)?;
        writeln!(out, "MSE               {:.6e}", metrics.mse)?;
        writeln!(out, "relMSE            {:.6e}   mean((x−r)²/(r²+0.01))", metrics.rel_mse)?;
        writeln!(out, "FLIP              {:.6}   at {:+} stops", metrics.flip, metrics.flip_exposure)?;
        writeln!(out, "max difference    {:.6e}", metrics.max_difference)?;
        writeln!(out, "mean difference   {:.6e}", metrics.mean_difference)?;
        writeln!(out, "bias (R, G, B)    {red:+.4e} {green:+.4e} {blue:+.4e}")?;
        write!(out, "relative bias     {:+.4e}", metrics.relative_bias)?;
        if metrics.non_finite_pixels > 0 {
            write!(out, "\nNaN or infinite   {} pixels", metrics.non_finite_pixels)?;
        }
        match &self.z_test {
            None => write!(
                out,
                "\nz-test            none: it needs variance and sample counts of both pictures, and two samples a pixel of one"
            ),
            Some(test) => {
                let [x, y] = test.worst_pixel;
                let [red, green, blue] = test.z_mean;
                let channel = ["R", "G", "B"][test.worst_channel];
                writeln!(out, "\nz-test            p = {:.3e}", test.p)?;
                writeln!(
                    out,
                    "  blocks          p = {:.3e}   worst z = {:+.2} at ({x}, {y}) {channel}, {} tests of {} × {} pixels, z rms {:.3}",
                    test.p_blocks, test.worst_z, test.tests, test.block, test.block, test.z_rms
                )?;
                write!(
                    out,
                    "  mean            p = {:.3e}   z = {red:+.2} {green:+.2} {blue:+.2} (R, G, B)",
                    test.p_mean
                )?;
                if test.skipped_pixels > 0 {
                    write!(out, "\n  left out        {} pixels without samples", test.skipped_pixels)?;
                }
                Ok(())
            }
        }
    }
}

/// The signed difference x − r of the beauty planes, as a picture.
pub fn difference(image: &Picture, reference: &Picture) -> Result<Picture, Error> {
    let [beauty, truth] = beauties(image, reference)?;
    let pixels: Vec<[f32; 3]> =
        beauty.iter().zip(&truth).map(|(x, r)| std::array::from_fn(|channel| x[channel] - r[channel])).collect();
    let mut picture = Picture::new(image.width, image.height);
    picture.set_rgb(plane::BEAUTY, &pixels);
    Ok(picture)
}

/// Writes [`difference_rgb8`] as a PNG.
pub fn write_difference_png(
    path: impl AsRef<Path>,
    image: &Picture,
    reference: &Picture,
    scale: f32,
) -> Result<(), Error> {
    let pixels = difference_rgb8(image, reference, scale)?;
    Ok(image::write_rgb8(path, image.width, image.height, &pixels)?)
}

/// The relative difference of luminance, (Y(x) − Y(r)) / (Y(r) + 0.01), in false colour, three bytes a pixel: black where the
/// pictures agree, through red to yellow where x is brighter, through blue to cyan where it is darker, white where either
/// is not a number; full colour at ±`scale`.
pub fn difference_rgb8(image: &Picture, reference: &Picture, scale: f32) -> Result<Vec<u8>, Error> {
    let luminance = |[red, green, blue]: [f32; 3]| 0.2126 * red + 0.7152 * green + 0.0722 * blue;
    let [beauty, truth] = beauties(image, reference)?;
    let color = |(x, r): (&[f32; 3], &[f32; 3])| {
        let relative = (luminance(*x) - luminance(*r)) / (luminance(*r) + 0.01) / scale;
        let first = (relative.abs() * 2.0).clamp(0.0, 1.0);
        let second = (relative.abs() * 2.0 - 1.0).clamp(0.0, 1.0);
        let color = match relative {
            _ if relative.is_nan() => [1.0; 3],
            _ if relative > 0.0 => [first, second, 0.0],
            _ => [0.0, second, first],
        };
        color.map(|value| (value * 255.0).round() as u8)
    };
    Ok(beauty.iter().zip(&truth).flat_map(color).collect())
}

/// Writes `image.exr`, `reference.exr`, `difference.exr`, `difference.png`, `p-values.exr` and `report.txt` to
/// `target/evidence/NAME/` and returns that directory.
pub fn write_evidence(
    name: &str,
    image: &Picture,
    reference: &Picture,
    comparison: &Comparison,
) -> Result<PathBuf, Error> {
    let directory = Path::new("target/evidence").join(name);
    std::fs::create_dir_all(&directory).map_err(|source| image::Error::Io { path: directory.clone(), source })?;
    let metadata = Metadata::default();
    image::write_exr(directory.join("image.exr"), image, &metadata)?;
    image::write_exr(directory.join("reference.exr"), reference, &metadata)?;
    image::write_exr(directory.join("difference.exr"), &difference(image, reference)?, &metadata)?;
    write_difference_png(directory.join("difference.png"), image, reference, 0.1)?;
    if let Some(test) = &comparison.z_test {
        image::write_exr(directory.join("p-values.exr"), &test.p_values(image.width, image.height), &metadata)?;
    }
    image::write_file(directory.join("report.txt"), format!("{comparison}\n"))?;
    Ok(directory)
}

/// The z-test as a statement: `Ok` unless it rejects at `significance`, and then [`Error::Different`] with the
/// [evidence](write_evidence) on disk. Both pictures need variance and sample counts, one of them two samples a pixel.
pub fn prove_equal(name: &str, image: &Picture, reference: &Picture, significance: f64) -> Result<Comparison, Error> {
    let rejected = ZTest::for_noise(image, reference)?.rejects(significance);
    let comparison = Comparison::of(image, reference, 0.0)?;
    if rejected {
        let evidence = write_evidence(name, image, reference, &comparison)?;
        return Err(Error::Different { name: name.to_owned(), comparison: Box::new(comparison), evidence });
    }
    Ok(comparison)
}
