//! Tensor files: named arrays of numbers, the container of the RGL's `.bsdf` files.
//!
//! Little-endian: the magic `tensor_file` with a zero, the version as two bytes (1, 0), the number of fields as `u32`; for each the length of its
//! name as `u16`, the name, the number of dimensions as `u16`, the type of its numbers as a byte, where they stand in the
//! file as `u64`, and its shape, a `u64` each. The last dimension runs fastest.

use std::path::{Path, PathBuf};

use crate::scene::error::{Error, Place, quote, read_bytes};

const MAGIC: &[u8] = b"tensor_file\0\x01\0";
/// Longest file, bytes: the longest published RGB one is below 100 MiB.
const LONGEST: u64 = 512 << 20;
const MOST_FIELDS: u32 = 256;
const MOST_DIMENSIONS: u16 = 8;
const NUMBERS_AT: u64 = 8;

/// The types of numbers that files may hold, by their codes, and how long a number is.
const TYPES: [(&str, u64); 12] = [
    ("nothing", 0),
    ("u8", 1),
    ("i8", 1),
    ("u16", 2),
    ("i16", 2),
    ("u32", 4),
    ("i32", 4),
    ("u64", 8),
    ("i64", 8),
    ("f16", 2),
    ("f32", 4),
    ("f64", 8),
];
/// Their codes.
pub(super) const U8: u8 = 1;
pub(super) const F32: u8 = 10;

/// A tensor file in memory, each field within its bounds.
pub(super) struct TensorFile {
    path: PathBuf,
    bytes: Vec<u8>,
    fields: Vec<Field>,
}

struct Field {
    name: String,
    kind: u8,
    shape: Vec<u64>,
    start: usize,
    length: usize,
}

impl TensorFile {
    pub fn read(path: &Path, needed_by: Option<&Place>) -> Result<TensorFile, Error> {
        let bytes = read_bytes(path, needed_by, LONGEST)?;
        if !bytes.starts_with(MAGIC) {
            let found = "a file that does not begin as one";
            return Err(Error::unexpected(Place::file(path), found, "a tensor file, version 1.0"));
        }
        let mut cursor = Cursor { path, bytes: &bytes, at: MAGIC.len() };
        let count = u32::from_le_bytes(cursor.take()?);
        if count > MOST_FIELDS {
            return Err(Error::unexpected(
                Place::file(path),
                format!("{count} fields"),
                format!("at most {MOST_FIELDS}"),
            ));
        }
        let fields = (0..count).map(|_| cursor.field()).collect::<Result<_, Error>>()?;
        Ok(TensorFile { path: path.to_owned(), bytes, fields })
    }

    /// Where a field is, for messages.
    pub fn place(&self, name: &str) -> Place {
        Place { field: Some(name.to_owned()), ..Place::file(&self.path) }
    }

    pub fn has(&self, name: &str) -> bool {
        self.fields.iter().any(|field| field.name == name)
    }

    /// The shape and the bytes of a field of N dimensions and one type.
    pub fn field<const N: usize>(&self, name: &str, kind: u8) -> Result<([usize; N], &[u8]), Error> {
        let Some(field) = self.fields.iter().find(|field| field.name == name) else {
            return Err(Error::unexpected(Place::file(&self.path), "no such field", format!("a field `{name}`")));
        };
        let wanted = || format!("{N} dimensions of {}", TYPES[usize::from(kind)].0);
        let shape: Vec<usize> = field.shape.iter().map(|&side| side as usize).collect();
        match shape.try_into() {
            Ok(shape) if field.kind == kind => Ok((shape, &self.bytes[field.start..field.start + field.length])),
            _ => {
                let found = format!("the shape {:?} of {}", field.shape, TYPES[usize::from(field.kind)].0);
                Err(Error::unexpected(self.place(name), found, wanted()))
            }
        }
    }

    /// The shape and the numbers of a field of `f32`, each finite and within bounds.
    pub fn floats<const N: usize>(&self, name: &str, [least, most]: [f32; 2]) -> Result<([usize; N], Vec<f32>), Error> {
        let (shape, bytes) = self.field(name, F32)?;
        let (numbers, _) = bytes.as_chunks();
        let numbers: Vec<f32> = numbers.iter().map(|number| f32::from_le_bytes(*number)).collect();
        match numbers.iter().position(|number| !(least..=most).contains(number)) {
            None => Ok((shape, numbers)),
            Some(index) => {
                let found = format!("{:e} as its number {index}", numbers[index]);
                Err(Error::unexpected(self.place(name), found, format!("numbers from {least:e} to {most:e}")))
            }
        }
    }
}

/// What is left of a header.
struct Cursor<'a> {
    path: &'a Path,
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Cursor<'a> {
    fn slice(&mut self, length: usize) -> Result<&'a [u8], Error> {
        let slice = self.bytes.get(self.at..).and_then(|rest| rest.get(..length)).ok_or_else(|| {
            let found = format!("the end of the file after {} bytes", self.bytes.len());
            Error::unexpected(Place::file(self.path), found, "its list of fields")
        })?;
        self.at += length;
        Ok(slice)
    }

    fn take<const N: usize>(&mut self) -> Result<[u8; N], Error> {
        let mut number = [0; N];
        number.copy_from_slice(self.slice(N)?);
        Ok(number)
    }

    fn field(&mut self) -> Result<Field, Error> {
        let length = u16::from_le_bytes(self.take()?);
        let name = String::from_utf8_lossy(self.slice(length.into())?).into_owned();
        let path = self.path;
        let error = |found: String, expected: String| {
            let place = Place { field: Some(quote(&name)), ..Place::file(path) };
            Error::unexpected(place, found, expected)
        };
        let dimensions = u16::from_le_bytes(self.take()?);
        let [kind] = self.take()?;
        let start = u64::from_le_bytes(self.take()?);
        if dimensions > MOST_DIMENSIONS {
            return Err(error(format!("{dimensions} dimensions"), format!("at most {MOST_DIMENSIONS}")));
        }
        let shape: Vec<u64> =
            (0..dimensions).map(|_| Ok(u64::from_le_bytes(self.take()?))).collect::<Result<_, Error>>()?;
        let Some(&(_, bytes)) = TYPES.get(usize::from(kind)).filter(|(_, bytes)| *bytes > 0) else {
            return Err(error(format!("numbers of type {kind}"), format!("1 to {}", TYPES.len() - 1)));
        };
        let length = shape.iter().try_fold(bytes, |product, side| product.checked_mul(*side));
        let end = length.and_then(|length| start.checked_add(length));
        match (length, end) {
            (Some(length), Some(end)) if end <= self.bytes.len() as u64 => {
                Ok(Field { name, kind, shape, start: start as usize, length: length as usize })
            }
            _ => {
                let found = format!("the shape {shape:?} from byte {start} on");
                Err(error(found, format!("data that ends within the file's {} bytes", self.bytes.len())))
            }
        }
    }
}

/// A field to write: name, type, shape and bytes.
pub(super) type Output<'a> = (&'a str, u8, Vec<usize>, Vec<u8>);

/// The bytes of a tensor file.
pub(super) fn encode(fields: &[Output]) -> Vec<u8> {
    let header: usize = fields.iter().map(|(name, _, shape, _)| 13 + name.len() + 8 * shape.len()).sum();
    let mut start = ((MAGIC.len() + 4 + header) as u64).next_multiple_of(NUMBERS_AT);
    let mut bytes = MAGIC.to_vec();
    bytes.extend((fields.len() as u32).to_le_bytes());
    for (name, kind, shape, data) in fields {
        bytes.extend((name.len() as u16).to_le_bytes());
        bytes.extend(name.as_bytes());
        bytes.extend((shape.len() as u16).to_le_bytes());
        bytes.push(*kind);
        bytes.extend(start.to_le_bytes());
        shape.iter().for_each(|side| bytes.extend((*side as u64).to_le_bytes()));
        start = (start + data.len() as u64).next_multiple_of(NUMBERS_AT);
    }
    for (.., data) in fields {
        bytes.resize(bytes.len().next_multiple_of(NUMBERS_AT as usize), 0);
        bytes.extend(data);
    }
    bytes
}
