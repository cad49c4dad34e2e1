//! Files that another file names, as the system that this one comes from spells them.

use std::fs;
use std::path::{Path, PathBuf};

use toml::de::DeValue;

use super::brdf;
use super::error::{Place, Warning, quote};
use super::file::LONGEST_FILE;
use super::table::{Source, read_text};

/// Most folders and files in a name that is looked for in other cases, as each may take the listing of a folder.
const MOST_PARTS: usize = 32;

/// The files that a TOML file names, a scene's or a material's, without a look into them: wherever a text in it is the name of a file. None of
/// another kind of file, or of one that cannot be read.
pub fn named_files(path: impl AsRef<Path>) -> Vec<PathBuf> {
    let path = path.as_ref();
    let mut files = Vec::new();
    let text =
        if brdf::ending(path) == "toml" { read_text(path, LONGEST_FILE).unwrap_or_default() } else { String::new() };
    if let Ok(table) = (Source { file: path, text: &text }).parse() {
        let mut named = |name: &str| files.push(beside(&Place::file(path), name, &mut Vec::new()));
        table.get_ref().values().for_each(|value| each_text(value.get_ref(), &mut named));
    }
    files.retain(|file| file.is_file());
    files
}

/// Hands on the texts in a value.
fn each_text(value: &DeValue, hand_on: &mut impl FnMut(&str)) {
    match value {
        DeValue::String(text) => hand_on(text),
        DeValue::Array(values) => values.iter().for_each(|value| each_text(value.get_ref(), hand_on)),
        DeValue::Table(table) => table.values().for_each(|value| each_text(value.get_ref(), hand_on)),
        _ => {}
    }
}

/// The file that is where a name in a file says, to which it is relative. Unless there is one of that very name, quotes are dropped,
/// backslashes part folders, and letters may be in another case, of which a warning tells.
pub(super) fn there(place: &Place, name: &str, warnings: &mut Vec<Warning>) -> Option<PathBuf> {
    let folder = place.file.parent().unwrap_or(Path::new(""));
    let exact = folder.join(name);
    if exact.exists() {
        return Some(exact);
    }
    let plain = plain(name);
    let found = in_any_case(folder, Path::new(&plain))?;
    if found != folder.join(&plain) {
        warnings.push(taken(place, name, &found));
    }
    Some(found)
}

/// The same; of a file that is not where its name says, the one of that name beside the file that names it, with a warning. If there is none
/// at all it is the path that the name says.
pub(super) fn beside(place: &Place, name: &str, warnings: &mut Vec<Warning>) -> PathBuf {
    if let Some(found) = there(place, name, warnings) {
        return found;
    }
    let folder = place.file.parent().unwrap_or(Path::new(""));
    let plain = plain(name);
    match Path::new(&plain).file_name().and_then(|alone| in_any_case(folder, Path::new(alone))) {
        Some(found) => {
            warnings.push(taken(place, name, &found));
            found
        }
        None => folder.join(name),
    }
}

/// A name without the comment that may follow it in a line of an MTL or OBJ file.
pub(super) fn uncommented(name: &str) -> &str {
    name.match_indices('#')
        .map(|(at, _)| &name[..at])
        .find(|name| name.ends_with(char::is_whitespace))
        .map_or(name, str::trim_end)
}

fn plain(name: &str) -> String {
    name.trim_matches('"').replace('\\', "/")
}

fn taken(place: &Place, name: &str, found: &Path) -> Warning {
    Warning { place: place.clone(), message: format!("there is no {}: {} is taken", quote(name), found.display()) }
}

/// The file in a folder whose name, part by part, is that one but for the case of letters.
fn in_any_case(folder: &Path, name: &Path) -> Option<PathBuf> {
    if name.components().nth(MOST_PARTS).is_some() {
        return None;
    }
    let mut path = folder.to_owned();
    for part in name.components() {
        let exact = path.join(part);
        if exact.exists() {
            path = exact;
            continue;
        }
        let folded = |name: &std::ffi::OsStr| name.to_string_lossy().to_lowercase();
        let wanted = folded(part.as_os_str());
        let here = if path.as_os_str().is_empty() { Path::new(".") } else { &path };
        let names = fs::read_dir(here).ok()?.flatten().map(|entry| entry.file_name());
        path.push(names.filter(|name| folded(name) == wanted).min()?);
    }
    path.is_file().then_some(path)
}
