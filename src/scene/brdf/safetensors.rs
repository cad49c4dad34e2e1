//! Safetensors: the length of a header (8 bytes, little-endian), the header (JSON: tensor → type, shape, place), numbers.
//! <https://huggingface.co/docs/safetensors>

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde_json::{Map, Value};

use super::super::error::{Error, Place, quote, read_bytes};

/// Longest file, bytes.
const LONGEST_FILE: u64 = 256 << 20;
/// Longest header, bytes: that of some 10⁴ tensors.
const LONGEST_HEADER: u64 = 4 << 20;

/// A file of named tensors.
pub(super) struct Safetensors {
    file: PathBuf,
    header: Map<String, Value>,
    data: Vec<u8>,
}

/// What the header says of a tensor.
#[derive(Deserialize)]
struct Entry {
    dtype: String,
    shape: Vec<u64>,
    data_offsets: [u64; 2],
}

impl Safetensors {
    pub fn read(path: &Path, needed_by: Option<&Place>) -> Result<Safetensors, Error> {
        let mut data = read_bytes(path, needed_by, LONGEST_FILE)?;
        let unexpected = |found: String, expected: &str| Err(Error::unexpected(Place::file(path), found, expected));
        let Some((length, rest)) = data.split_first_chunk() else {
            return unexpected(format!("{} bytes", data.len()), "the length of a header, 8 bytes");
        };
        let length = u64::from_le_bytes(*length);
        if length > LONGEST_HEADER || length > rest.len() as u64 {
            let found = format!("a header of {length} bytes in a file of {}", data.len());
            return unexpected(found, "one that fits into the file, and at most 4 MiB");
        }
        let header = match serde_json::from_slice(&rest[..length as usize]) {
            Ok(header) => header,
            Err(error) => return unexpected(format!("a broken header ({error})"), "a JSON object"),
        };
        data.drain(..8 + length as usize);
        Ok(Safetensors { file: path.to_owned(), header, data })
    }

    /// What stands in front of the last `/` of the tensors' names, each once, in alphabetical order.
    pub fn prefixes(&self) -> BTreeSet<&str> {
        self.header.keys().filter_map(|name| name.rsplit_once('/')).map(|(prefix, _)| prefix).collect()
    }

    /// The finite `f32` numbers of a tensor of a given shape, row by row.
    pub fn floats(&self, name: &str, shape: &[u64]) -> Result<Vec<f32>, Error> {
        let place = Place { field: Some(quote(name)), ..Place::file(&self.file) };
        let unexpected = |found: String, expected: String| Err(Error::unexpected(place.clone(), found, expected));
        let Some(entry) = self.header.get(name) else {
            return unexpected("no such tensor".into(), format!("one of shape {shape:?}"));
        };
        let entry = match Entry::deserialize(entry) {
            Ok(entry) => entry,
            Err(error) => {
                return unexpected(format!("a broken entry ({error})"), "dtype, shape and data_offsets".into());
            }
        };
        if entry.dtype != "F32" || entry.shape != shape {
            let shown = &entry.shape[..entry.shape.len().min(8)];
            return unexpected(
                format!("{} of shape {shown:?}", quote(&entry.dtype)),
                format!("F32 of shape {shape:?}"),
            );
        }
        let bytes = 4 * shape.iter().product::<u64>();
        let [start, end] = entry.data_offsets;
        if start.checked_add(bytes) != Some(end) || end > self.data.len() as u64 {
            let expected = format!("{bytes} bytes within the {} that follow the header", self.data.len());
            return unexpected(format!("the bytes from {start} to {end}"), expected);
        }
        super::finite_floats(&self.data[start as usize..end as usize], &place)
    }
}
