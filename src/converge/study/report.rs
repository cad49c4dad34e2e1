//! Writes what a study found: a page to read, a table, and every number.

use std::path::{Path, PathBuf};

use serde_json::json;

use super::analysis::Analysis;
use super::csv::csv;
use super::error::Error;
use super::html::page;
use super::record::Record;
use crate::image::write_file;

/// Writes `report.html`, `runs.csv` and `analysis.json` beside the record; returns the page's path. The pictures that runs have left in
/// `directory` become thumbnails.
pub fn write_report(record: &Record, analysis: &Analysis, directory: &Path) -> Result<PathBuf, Error> {
    let write = |name: &str, text: &str| -> Result<PathBuf, Error> {
        let path = directory.join(name);
        write_file(&path, text)?;
        Ok(path)
    };
    write("runs.csv", &csv(record))?;
    write("analysis.json", &format!("{:#}\n", json!(analysis)))?;
    write("report.html", &page(record, analysis, directory)?)
}
