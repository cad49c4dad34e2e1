//! EXR files: one part, scan lines, ZIP, `f32` and `u32` channels named as [`plane`](super::plane) says.

use std::fs::File;
use std::io::{BufReader, Seek};
use std::path::Path;

use exr::image::{AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer};
use exr::math::Vec2;
use exr::meta::MetaData;
use exr::meta::attribute::{IntegerBounds, Text};
use exr::meta::header::LayerAttributes;
use exr::prelude::{ReadChannels, ReadLayers, WritableImage};

use super::{Error, Metadata, Picture, Samples, atomic_write};

/// Deflate packs at best 1032 to 1 and it is the tightest of EXR's codecs that pictures use; with what a header costs, a
/// file that promises more than this many bytes a byte is damaged.
const MOST_BYTES_A_BYTE: u128 = 1100;

/// Writes all planes of a picture and how it was made.
pub fn write_exr(path: impl AsRef<Path>, picture: &Picture, metadata: &Metadata) -> Result<(), Error> {
    let path = path.as_ref();
    let encode_error = |reason: String| Error::Encode { path: path.to_owned(), reason };

    let channels = picture.planes().map(|(name, samples)| {
        let name = Text::new_or_none(name)
            .ok_or_else(|| encode_error(format!("channel name {name:?} has characters beyond Latin-1")))?;
        Ok(AnyChannel::new(
            name,
            match samples {
                Samples::F32(samples) => FlatSamples::F32(samples.clone()),
                Samples::U32(samples) => FlatSamples::U32(samples.clone()),
            },
        ))
    });
    let channels = AnyChannels::sort(channels.collect::<Result<_, Error>>()?);

    let size = Vec2(picture.width as usize, picture.height as usize);
    let coordinate = |value: u32| i32::try_from(value).map_err(|_| encode_error(format!("{value} is off the film")));
    let attributes = LayerAttributes {
        layer_position: Vec2(coordinate(metadata.crop_origin[0])?, coordinate(metadata.crop_origin[1])?),
        software_name: Text::new_or_none(format!("neubrdf {}", metadata.version)),
        vertical_field_of_view: Some(metadata.vertical_fov_degrees),
        other: metadata.attributes(picture.paths_shared_by),
        ..LayerAttributes::default()
    };
    let layer = Layer::new(size, attributes, Encoding::SMALL_LOSSLESS, channels);
    let mut image = Image::from_layer(layer);
    let film_size = match metadata.film_size {
        [0, _] | [_, 0] => size,
        [width, height] => Vec2(width as usize, height as usize),
    };
    image.attributes.display_window = IntegerBounds::from_dimensions(film_size);

    atomic_write(path, |writer| {
        image.write().to_buffered(writer).map_err(|error| match error {
            exr::error::Error::Io(source) => Error::Io { path: path.to_owned(), source },
            error => encode_error(error.to_string()),
        })
    })
}

/// Reads the first layer of an EXR file, ours or another's; half becomes `f32`.
///
/// The file is not trusted: the header is checked against the file's size before anything is allocated.
pub fn read_exr(path: impl AsRef<Path>) -> Result<(Picture, Metadata), Error> {
    let path = path.as_ref();
    let io_error = |source| Error::Io { path: path.to_owned(), source };
    let exr_error = |error: exr::error::Error| match error {
        exr::error::Error::Io(source) => Error::Io { path: path.to_owned(), source },
        error => Error::Exr { path: path.to_owned(), reason: error.to_string() },
    };

    let file = File::open(path).map_err(io_error)?;
    let file_metadata = file.metadata().map_err(io_error)?;
    if !file_metadata.is_file() {
        return Err(io_error(std::io::Error::other("is not a regular file; expected an EXR file")));
    }
    let mut reader = BufReader::new(file);
    let header = MetaData::read_from_buffered(&mut reader, false).map_err(exr_error)?;
    check_plausible(path, &header, file_metadata.len())?;
    reader.rewind().map_err(io_error)?;

    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_buffered(reader)
        .map_err(exr_error)?;

    let layer = image.layer_data;
    let dimension = |value: usize| {
        u32::try_from(value)
            .map_err(|_| Error::Exr { path: path.to_owned(), reason: format!("a side of {value} pixels") })
    };
    let mut picture = Picture::new(dimension(layer.size.width())?, dimension(layer.size.height())?);
    for channel in layer.channel_data.list {
        let name = channel.name.to_string();
        let samples = match channel.sample_data {
            FlatSamples::F16(samples) => Samples::F32(samples.iter().map(|sample| sample.to_f32()).collect()),
            FlatSamples::F32(samples) => Samples::F32(samples),
            FlatSamples::U32(samples) => Samples::U32(samples),
        };
        if samples.len() != picture.pixels() {
            let reason = format!("channel {name:?} is subsampled");
            return Err(Error::Exr { path: path.to_owned(), reason });
        }
        picture.set(name, samples);
    }
    picture.paths_shared_by = Metadata::paths_shared_by(&layer.attributes.other);

    let unsigned = |value: i32| u32::try_from(value).unwrap_or(0);
    let display = image.attributes.display_window;
    let metadata = Metadata {
        film_size: [dimension(display.size.width())?, dimension(display.size.height())?],
        crop_origin: [
            unsigned(layer.attributes.layer_position.x().saturating_sub(display.position.x())),
            unsigned(layer.attributes.layer_position.y().saturating_sub(display.position.y())),
        ],
        ..Metadata::from_attributes(&layer.attributes.other)
    };
    Ok((picture, metadata))
}

/// Whether the file is long enough for what its headers promise.
fn check_plausible(path: &Path, meta_data: &MetaData, file_bytes: u64) -> Result<(), Error> {
    for header in &meta_data.headers {
        let Vec2(width, height) = header.layer_size;
        let promised_bytes = width as u128 * height as u128 * header.channels.bytes_per_pixel as u128;
        // Every chunk has an eight-byte entry in the offset table.
        let fits =
            promised_bytes <= u128::from(file_bytes) * MOST_BYTES_A_BYTE && header.chunk_count as u64 <= file_bytes / 8;
        if !fits {
            return Err(Error::Implausible {
                path: path.to_owned(),
                width,
                height,
                channels: header.channels.list.len(),
                promised_bytes,
                file_bytes,
            });
        }
    }
    Ok(())
}
