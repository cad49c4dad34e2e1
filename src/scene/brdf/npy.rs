//! NumPy's `.npy`: magic, version, the length of a header, the header (a Python dictionary), numbers.
//! <https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html>

use std::path::Path;

use super::super::error::{Error, Place, quote, read_bytes};

/// Longest file, bytes.
const LONGEST_FILE: u64 = 1 << 20;

/// The finite `f32` numbers of an array of a given shape, row by row.
pub(super) fn floats(path: &Path, shape: &[u64], needed_by: Option<&Place>) -> Result<Vec<f32>, Error> {
    let bytes = read_bytes(path, needed_by, LONGEST_FILE)?;
    let place = Place::file(path);
    let Some((header, data)) = split(&bytes) else {
        return Err(Error::unexpected(place, "another kind of file, or part of one", "an array in NumPy's format"));
    };
    let lengths: Vec<String> = shape.iter().map(u64::to_string).collect();
    let expected = match lengths.as_slice() {
        [length] => format!("({length},)"),
        lengths => format!("({})", lengths.join(", ")),
    };
    let wanted = [("descr", "'<f4'".to_owned()), ("fortran_order", "False".to_owned()), ("shape", expected)];
    for (key, wanted) in wanted {
        let found = value(header, key).unwrap_or("nothing");
        if found.replace(' ', "") != wanted.replace(' ', "") {
            let place = Place { field: Some(key.to_owned()), ..place };
            return Err(Error::unexpected(place, quote(found), wanted));
        }
    }
    let count = shape.iter().product::<u64>();
    if data.len() as u64 != 4 * count {
        let found = format!("{} bytes behind the header", data.len());
        return Err(Error::unexpected(place, found, format!("{count} numbers of 4 bytes")));
    }
    super::finite_floats(data, &place)
}

/// The header's text and the data behind it.
fn split(bytes: &[u8]) -> Option<(&str, &[u8])> {
    let rest = bytes.strip_prefix(b"\x93NUMPY")?;
    let (version, rest) = rest.split_first_chunk::<2>()?;
    let (length, rest) = if version[0] == 1 {
        let (length, rest) = rest.split_first_chunk()?;
        (usize::from(u16::from_le_bytes(*length)), rest)
    } else {
        let (length, rest) = rest.split_first_chunk()?;
        (u32::from_le_bytes(*length) as usize, rest)
    };
    let (header, data) = rest.split_at_checked(length)?;
    Some((std::str::from_utf8(header).ok()?, data))
}

/// What stands behind a key of the dictionary, up to the comma that ends it.
fn value<'a>(header: &'a str, key: &str) -> Option<&'a str> {
    let (_, rest) = header.split_once(&format!("'{key}'"))?;
    let rest = rest.trim_start().strip_prefix(':')?.trim_start();
    let end = if rest.starts_with('(') { rest.find(')')? + 1 } else { rest.find([',', '}'])? };
    Some(&rest[..end])
}
