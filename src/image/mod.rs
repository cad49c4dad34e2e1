//! Pictures in memory and on disk: EXR with named planes and render metadata, tone-mapped PNG.
//!
//! Nothing here knows how a picture came to be. Files are written beside their target and renamed
//! ([`atomic_write`]), so an interrupted run leaves the old file or the new one, never half of one; what is to be gone on with
//! is sealed by a hash ([`write_sealed`]).

mod atomic;
mod exr_file;
mod metadata;
mod page;
mod picture;
mod sealed;
pub mod tone_map;

use std::path::{Path, PathBuf};

pub use atomic::{atomic_write, check_writable, write_file};
pub use exr_file::{read_exr, write_exr};
pub use metadata::Metadata;
pub use page::{escaped, png_address};
pub use picture::{Crop, Picture, Samples, plane};
pub use sealed::{open_sealed, write_sealed};

/// What can go wrong with a picture file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The operating system said no.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file that was read or written.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The file is not an EXR that we can read.
    #[error("{}: not a readable EXR file: {reason}; expected a flat (not deep) image of half, float or uint channels", path.display())]
    Exr {
        /// The file that was read.
        path: PathBuf,
        /// What was found.
        reason: String,
    },
    /// The header promises more than the file can hold.
    #[error(
        "{}: the header promises {promised_bytes} bytes of pixels ({width}×{height}, {channels} channels), \
         more than a file of {file_bytes} bytes can hold; the file is damaged",
        path.display()
    )]
    Implausible {
        /// The file that was read.
        path: PathBuf,
        /// Width that the header gives, pixels.
        width: usize,
        /// Height that the header gives, pixels.
        height: usize,
        /// Number of channels that the header lists.
        channels: usize,
        /// Their size in memory.
        promised_bytes: u128,
        /// The file's size.
        file_bytes: u64,
    },
    /// The picture lacks planes that are needed here.
    #[error("{}: no channel {missing:?}; found {found}", path.display())]
    MissingPlane {
        /// The file that was to be written.
        path: PathBuf,
        /// The plane that is needed.
        missing: String,
        /// The planes that there are.
        found: String,
    },
    /// The picture could not be encoded.
    #[error("{}: cannot encode the picture: {reason}", path.display())]
    Encode {
        /// The file that was to be written.
        path: PathBuf,
        /// What the encoder said.
        reason: String,
    },
}

/// Writes the beauty planes as an 8-bit sRGB PNG through the [tone map](tone_map), `exposure` in stops.
pub fn write_png(path: impl AsRef<Path>, picture: &Picture, exposure: f32) -> Result<(), Error> {
    let path = path.as_ref();
    let beauty = picture.rgb(plane::BEAUTY).ok_or_else(|| Error::MissingPlane {
        path: path.to_owned(),
        missing: plane::BEAUTY.join(", "),
        found: picture.names().collect::<Vec<_>>().join(", "),
    })?;
    write_rgb8(path, picture.width, picture.height, &tone_map::to_srgb8(&beauty, exposure))
}

/// Writes `width × height` 8-bit RGB pixels, row by row from the top, as they are.
pub fn write_rgb8(path: impl AsRef<Path>, width: u32, height: u32, pixels: &[u8]) -> Result<(), Error> {
    let path = path.as_ref();
    atomic_write(path, |writer| {
        encode_png(writer, width, height, pixels)
            .map_err(|error| Error::Encode { path: path.to_owned(), reason: error.to_string() })
    })
}

/// The same pixels as the bytes of a PNG file.
fn png_rgb8(width: u32, height: u32, pixels: &[u8]) -> Result<Vec<u8>, Error> {
    let mut bytes = Vec::new();
    encode_png(&mut bytes, width, height, pixels)
        .map_err(|error| Error::Encode { path: "a picture".into(), reason: error.to_string() })?;
    Ok(bytes)
}

fn encode_png(writer: impl std::io::Write, width: u32, height: u32, pixels: &[u8]) -> Result<(), ::image::ImageError> {
    use ::image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};
    PngEncoder::new(writer).write_image(pixels, width, height, ExtendedColorType::Rgb8)
}
