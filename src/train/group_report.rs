//! What training a group came to.

use std::fmt::Write;
use std::path::Path;

use serde::Serialize;
use serde_json::json;

use super::report::{STYLE, means, table_of_figures};
use super::{Error, Figure, Report};
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
    /// The means of the members' figures.
    pub fn means(&self) -> Vec<Figure> {
        means(&self.members.iter().flat_map(|member| member.judged.figures()).collect::<Vec<_>>())
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
        let mut rows: Vec<(String, Vec<Figure>)> =
            self.members.iter().map(|member| (escaped(&member.source), member.judged.figures())).collect();
        rows.push(("<b>mean</b>".to_owned(), self.means()));
        page.push_str(&table_of_figures("material", &rows));
        for (member, section) in self.members.iter().zip(sections) {
            let _ = writeln!(page, "<details><summary>{}</summary>\n{section}</details>", escaped(&member.source));
        }
        page
    }
}
