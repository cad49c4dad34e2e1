//! What training a group came to.

use std::fmt::Write;
use std::path::Path;

use serde::Serialize;
use serde_json::json;

use super::measure::FitErrors;
use super::report::STYLE;
use super::{Error, Report};
use crate::image::escaped;
use crate::image::write_file;

/// What training materials with common codebooks came to.
#[derive(Clone, Debug, Serialize)]
pub struct GroupReport {
    /// Whether the network is common, too.
    pub shares_network: bool,
    /// Seconds that training took, on the clock.
    pub seconds: f64,
    /// Size of the file.
    pub bytes: usize,
    /// What each came to, with its share of the file's size.
    pub members: Vec<Report>,
}

impl GroupReport {
    /// The mean of an error over the members.
    pub fn mean(&self, error: impl Fn(&FitErrors) -> f64) -> f64 {
        self.members.iter().map(|member| error(&member.errors)).sum::<f64>() / self.members.len() as f64
    }

    /// Writes the JSON.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write_json(&self, path: &Path) -> Result<(), Error> {
        Ok(write_file(path, format!("{:#}\n", json!(self)))?)
    }

    /// Writes a page of a table and each member's section ([`Report::section`]).
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write_html(&self, path: &Path, sections: &[String]) -> Result<(), Error> {
        Ok(write_file(path, self.html(sections))?)
    }

    fn html(&self, sections: &[String]) -> String {
        let count = self.members.len();
        let title = format!("{count} materials with one codebook a hemisphere");
        let network = if self.shares_network { "one network for all" } else { "a network each" };
        let mut page = format!("{STYLE}<title>{title}</title><h1>{title}</h1>\n");
        let _ = writeln!(page, "<p>{network}; {} bytes; training {:.1} s.</p>", self.bytes, self.seconds);
        page.push_str(
            "<table><tr><th>material</th><th>SSIM</th><th>ꟻLIP</th><th>mean |Δ ln(1 + f)|</th><th>relative RMSE</th><th>worst albedo</th></tr>\n",
        );
        let mut row = |name: &str, of: &dyn Fn(fn(&FitErrors) -> f64) -> f64| {
            let _ = writeln!(
                page,
                "<tr><td>{name}</td><td>{:.4}</td><td>{:.4}</td><td>{:.5}</td><td>{:.4}</td><td>{:.2} %</td></tr>",
                of(|errors| errors.ball.ssim),
                of(|errors| errors.ball.flip),
                of(|errors| errors.pairs.log),
                of(|errors| errors.pairs.relative_rmse),
                of(|errors| 100.0 * errors.worst_albedo)
            );
        };
        for member in &self.members {
            row(&escaped(&member.source), &|error| error(&member.errors));
        }
        row("<b>mean</b>", &|error| self.mean(error));
        page.push_str("</table>\n");
        for (member, section) in self.members.iter().zip(sections) {
            let _ = writeln!(page, "<details><summary>{}</summary>\n{section}</details>", escaped(&member.source));
        }
        page
    }
}
