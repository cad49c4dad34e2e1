//! Files that say what they hold and tell when they were changed.
//!
//! Layout, little-endian: 8 bytes magic, u32 length of a JSON header, the header, the content, and a BLAKE3 hash of all that.

use std::io::Write;
use std::path::Path;

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::{Error, atomic_write};

const HASH_BYTES: usize = 32;

/// Writes such a file, whole or not at all; its content is `parts`, one after another.
///
/// # Errors
/// The operating system says no, or `path` is there and no regular file that may be written.
pub fn write_sealed(path: &Path, magic: &[u8; 8], header: &impl Serialize, parts: &[&[u8]]) -> Result<(), Error> {
    let io_error = |source| Error::Io { path: path.to_owned(), source };
    let header = serde_json::to_vec(header).map_err(|error| io_error(error.into()))?;
    let length = (header.len() as u32).to_le_bytes();
    atomic_write(path, |file| {
        let mut hasher = blake3::Hasher::new();
        for part in [magic, &length[..], &header].iter().chain(parts) {
            hasher.update(part);
            file.write_all(part).map_err(io_error)?;
        }
        file.write_all(hasher.finalize().as_bytes()).map_err(io_error)
    })
}

/// The header and the content of such a file's bytes, if they are what was written; otherwise what is wrong, of which "it" is the file.
pub fn open_sealed<'a, H: DeserializeOwned>(bytes: &'a [u8], magic: &[u8; 8]) -> Result<(H, &'a [u8]), &'static str> {
    let (sealed, hash) = bytes.split_at_checked(bytes.len().wrapping_sub(HASH_BYTES)).ok_or("it is too short")?;
    let rest = sealed.strip_prefix(magic).ok_or("it does not begin like one")?;
    if blake3::hash(sealed).as_bytes() != hash {
        return Err("its checksum does not match: it was cut short or changed");
    }
    let (length, rest) = rest.split_first_chunk::<4>().ok_or("it is too short")?;
    let (header, content) =
        rest.split_at_checked(u32::from_le_bytes(*length) as usize).ok_or("its header is cut short")?;
    Ok((serde_json::from_slice(header).map_err(|_| "its header is of another version")?, content))
}
