//! What can go wrong while a scene is loaded, told so that the user can mend it.

use std::fmt;
use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

/// Where in the input something is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// The file.
    pub file: PathBuf,
    /// Line in it, from 1.
    pub line: Option<usize>,
    /// The TOML key, as `[camera] fov`, or the OBJ or MTL statement.
    pub field: Option<String>,
}

impl Place {
    /// A file as a whole.
    pub fn file(file: impl Into<PathBuf>) -> Place {
        Place { file: file.into(), line: None, field: None }
    }

    /// A line of a file.
    pub fn line(file: impl Into<PathBuf>, line: usize) -> Place {
        Place { file: file.into(), line: Some(line), field: None }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.file.display())?;
        if let Some(line) = self.line {
            write!(f, ":{line}")?;
        }
        if let Some(field) = &self.field {
            write!(f, ": {field}")?;
        }
        Ok(())
    }
}

/// Why a scene could not be loaded.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The system refused a file.
    #[error("{}: cannot be read: {source}{}", file.display(), wanted_by(needed_by.as_ref()))]
    Read {
        /// The file.
        file: PathBuf,
        /// What names it, unless the user did.
        needed_by: Option<Place>,
        /// The system's reason.
        source: io::Error,
    },
    /// The input is not what it should be.
    #[error("{place}: found {found}, expected {expected}{}", wanted_by(needed_by.as_deref()))]
    Unexpected {
        /// Where.
        place: Place,
        /// What names the file, if that is wrong as a whole and the user did not name it. Boxed, as every result has room for an error.
        needed_by: Option<Box<Place>>,
        /// What is there.
        found: String,
        /// What should be there.
        expected: String,
    },
    /// A key of the scene file that means nothing.
    #[error("{place}: unknown key `{key}`{}", suggestion(nearest))]
    UnknownKey {
        /// Where.
        place: Place,
        /// The key.
        key: String,
        /// The known key that it resembles most.
        nearest: String,
    },
}

fn wanted_by(place: Option<&Place>) -> String {
    place.map(|place| format!(" (named by {place})")).unwrap_or_default()
}

fn suggestion(nearest: &str) -> String {
    if nearest.is_empty() { String::new() } else { format!("; the nearest that is known is `{nearest}`") }
}

impl Error {
    pub(crate) fn unexpected(place: Place, found: impl Into<String>, expected: impl Into<String>) -> Error {
        Error::Unexpected { place, needed_by: None, found: found.into(), expected: expected.into() }
    }

    /// The same error, saying of a file that is wrong as a whole what names it, if that is not known yet.
    pub(crate) fn named_by(mut self, namer: Option<&Place>) -> Error {
        match &mut self {
            Error::Read { needed_by, .. } => *needed_by = needed_by.take().or(namer.cloned()),
            Error::Unexpected { place: Place { line: None, .. }, needed_by, .. } => {
                *needed_by = needed_by.take().or(namer.cloned().map(Box::new));
            }
            _ => {}
        }
        self
    }

    pub(crate) fn read(file: &Path, needed_by: Option<&Place>, source: io::Error) -> Error {
        Error::Read { file: file.to_owned(), needed_by: needed_by.cloned(), source }
    }
}

/// Opens a file for reading. A pipe or a device is refused, as reading it may never end.
pub(crate) fn open(path: &Path, needed_by: Option<&Place>) -> Result<File, Error> {
    let open = |path| match fs::metadata(path)? {
        metadata if metadata.is_file() => File::open(path),
        _ => Err(io::Error::other("it is not a regular file")),
    };
    open(path).map_err(|source| Error::read(path, needed_by, source))
}

/// What some programs begin a UTF-8 text with.
pub(crate) const BYTE_ORDER_MARK: &[u8] = "\u{feff}".as_bytes();

/// The bytes of a file of at most `longest` bytes.
pub(crate) fn read_bytes(path: &Path, needed_by: Option<&Place>, longest: u64) -> Result<Vec<u8>, Error> {
    let mut bytes = Vec::new();
    open(path, needed_by)?
        .take(longest + 1)
        .read_to_end(&mut bytes)
        .map_err(|source| Error::read(path, needed_by, source))?;
    if bytes.len() as u64 > longest {
        let most = if longest < 1 << 20 { format!("{longest} bytes") } else { format!("{} MiB", longest >> 20) };
        return Err(Error::unexpected(Place::file(path), format!("more than {most}"), "a shorter file"));
    }
    Ok(bytes)
}

/// Something odd in the input that did not stop the scene from loading.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    /// Where.
    pub place: Place,
    /// What is odd, and what was done about it.
    pub message: String,
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.place, self.message)
    }
}

/// The candidate at the smallest edit distance from `word`; empty if there are none.
pub(crate) fn nearest<'a>(word: &str, candidates: impl IntoIterator<Item = &'a str>) -> &'a str {
    candidates.into_iter().min_by_key(|candidate| edit_distance(word, candidate)).unwrap_or_default()
}

/// Levenshtein's distance, over at most the first 64 characters of each word.
fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().take(64).collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, from) in a.chars().take(64).enumerate() {
        let mut diagonal = std::mem::replace(&mut row[0], i + 1);
        for (j, to) in b.iter().enumerate() {
            let substituted = diagonal + usize::from(from != *to);
            diagonal = row[j + 1];
            row[j + 1] = substituted.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}

/// Text from the input, cut to what fits in a message and without control characters.
pub(crate) fn quote(text: &str) -> String {
    const LONGEST: usize = 60;
    let readable = |c: char| if c.is_control() { char::REPLACEMENT_CHARACTER } else { c };
    let start: String = text.chars().take(LONGEST).map(readable).collect();
    format!("`{start}{}`", if text.chars().nth(LONGEST).is_some() { "…" } else { "" })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edit_distance_counts_edits() {
        for (a, b, distance) in [("", "abc", 3), ("kitten", "sitting", 3), ("eye", "eye", 0), ("fov", "fvo", 2)] {
            assert_eq!(edit_distance(a, b), distance);
            assert_eq!(edit_distance(b, a), distance);
        }
        assert_eq!(nearest("roughnes", ["albedo", "roughness", "ior"]), "roughness");
    }
}
