//! Image files to linear Rec. 709 texels: PNG, JPEG, TGA and BMP (taken as sRGB), OpenEXR and Radiance (taken as linear).

use std::fs;
use std::io::{BufReader, Read};
use std::path::Path;
use std::sync::Arc;

use exr::prelude::{ReadChannels, ReadLayers};
use glam::Vec3;
use half::f16;
use image::codecs::hdr::HdrDecoder;
use image::{DynamicImage, GenericImageView, ImageDecoder, ImageError, ImageReader};

use super::error::{Error, Place, Warning, open};
use super::light::BRIGHTEST;
use super::{Environment, Texture};

/// Most texels that an image may have, so that a broken header is an error and not gigabytes of memory.
const MOST_TEXELS: u64 = 1 << 26;
/// Of these, how many need no evidence; beyond, a file must bring a byte for every [`TEXELS_PER_BYTE`].
const FREE_TEXELS: u64 = 1 << 22;
/// No codec compresses photographs or skies by more: deflate reaches 350 on constant colours.
const TEXELS_PER_BYTE: u64 = 1024;

/// Longest header of a Radiance file, bytes.
const LONGEST_HEADER: u64 = 1 << 16;

/// Texels row by row from the top.
struct Picture<T> {
    width: u32,
    height: u32,
    texels: Vec<T>,
}

/// Reads a texture from a PNG, JPEG, TGA, BMP, EXR or Radiance file, and tells whether that has an alpha channel that is not 1 everywhere, of which the texture
/// has nothing. Colours above 1, which only the last two can hold, are clamped with a warning.
pub(super) fn texture(path: &Path, named_by: &Place, warnings: &mut Vec<Warning>) -> Result<(Texture, bool), Error> {
    if let Some(picture) = read_linear(path, named_by)? {
        return Ok((shares(path, picture, warnings)?, false));
    }
    let image = read_image(path, named_by)?;
    let has_alpha = has_alpha(&image);
    Ok((of_picture(path, of_codes(image, srgb_to_linear)), has_alpha))
}

/// The same of numbers that are no colours: codes are taken as they are.
pub(super) fn numbers(path: &Path, named_by: &Place, warnings: &mut Vec<Warning>) -> Result<Texture, Error> {
    match read_linear(path, named_by)? {
        Some(picture) => shares(path, picture, warnings),
        None => Ok(of_picture(path, of_codes(read_image(path, named_by)?, |code| code))),
    }
}

/// Reads how much of a surface is there: the alpha of a file with such a channel, unless that is 1 everywhere; else the brightness, codes
/// taken as they are.
pub(super) fn opacity(path: &Path, named_by: &Place, warnings: &mut Vec<Warning>) -> Result<Texture, Error> {
    let grey = |number: f16| [number, number, number, f16::ONE];
    if let Some(picture) = read_linear(path, named_by)? {
        let mut texture = shares(path, picture, warnings)?;
        for texel in Arc::make_mut(&mut texture.texels) {
            let [red, green, blue, _] = texel.map(f16::to_f32);
            *texel = grey(f16::from_f32(Vec3::new(red, green, blue).dot(LUMINANCE)));
        }
        return Ok(texture);
    }
    let image = read_image(path, named_by)?;
    let counted = usize::from(has_alpha(&image));
    let image = image.into_luma_alpha16();
    let (width, height) = image.dimensions();
    let codes = image.pixels().map(|pixel| pixel.0[counted]);
    let texels = codes.map(|code| grey(f16::from_f32(f32::from(code) / 65535.0))).collect();
    Ok(of_picture(path, Picture { width, height, texels }))
}

/// Whether an image has an alpha channel that is not 1 everywhere.
fn has_alpha(image: &DynamicImage) -> bool {
    image.color().has_alpha() && image.pixels().any(|(_, _, pixel)| pixel.0[3] != u8::MAX)
}

/// Of linear Rec. 709.
const LUMINANCE: Vec3 = Vec3::new(0.2126, 0.7152, 0.0722);

/// A texture with its file's name.
fn of_picture(path: &Path, Picture { width, texels, .. }: Picture<[f16; 4]>) -> Texture {
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    Texture::new(name, width, texels)
}

/// Reads measurements, times `scale`, from a PNG, JPEG, TGA or BMP file, in sRGB or linear, or from a linear EXR or Radiance file.
pub(super) fn measured(path: &Path, is_srgb: bool, scale: f32) -> Result<Texture, Error> {
    let named_by = Place::file(path);
    let scaled = |color: Vec3| (color.max(Vec3::ZERO) * scale).min(Vec3::splat(f16::MAX.to_f32()));
    let picture = if let Some(picture) = read_linear(path, &named_by)? {
        check_texels(path, &picture, f32::MAX)?;
        let texels = picture.texels.iter().map(|color| scaled(*color).extend(1.0).to_array().map(f16::from_f32));
        Picture { width: picture.width, height: picture.height, texels: texels.collect() }
    } else {
        let mut picture = of_codes(read_image(path, &named_by)?, if is_srgb { srgb_to_linear } else { |code| code });
        for texel in &mut picture.texels {
            let [red, green, blue, _] = texel.map(f16::to_f32);
            *texel = scaled(Vec3::new(red, green, blue)).extend(1.0).to_array().map(f16::from_f32);
        }
        picture
    };
    Ok(of_picture(path, picture))
}

/// Reads a lat-long environment from an EXR or Radiance file, each radiance times `scale`. Negative radiances become 0 with a
/// warning.
pub(super) fn environment(
    path: &Path,
    named_by: &Place,
    scale: Vec3,
    warnings: &mut Vec<Warning>,
) -> Result<Environment, Error> {
    let Some(mut picture) = read_linear(path, named_by)? else {
        return Err(Error::unexpected(
            Place::file(path),
            "a file of another kind",
            "an OpenEXR or Radiance (.hdr) image",
        ));
    };
    change(&mut picture, |color| color * scale);
    check_texels(path, &picture, BRIGHTEST)?;
    let negative = change(&mut picture, |radiance| radiance.max(Vec3::ZERO));
    if negative > 0 {
        let message = format!("{negative} texels are negative: set to 0");
        warnings.push(Warning { place: Place::file(path), message });
    }
    let Picture { width, height, texels } = picture;
    Ok(Environment { width, height, texels, rotation_degrees: 0.0 })
}

/// Applies a function to every texel. Returns how many it changed.
fn change(picture: &mut Picture<Vec3>, function: impl Fn(Vec3) -> Vec3) -> usize {
    let mut changed = 0;
    for texel in &mut picture.texels {
        let new = function(*texel);
        changed += usize::from(new != *texel);
        *texel = new;
    }
    changed
}

/// Refuses colours that are not finite or exceed a bound.
fn check_texels(path: &Path, picture: &Picture<Vec3>, most: f32) -> Result<(), Error> {
    let fits = |color: &Vec3| color.is_finite() && color.max_element() <= most;
    match picture.texels.iter().position(|color| !fits(color)) {
        None => Ok(()),
        Some(index) => {
            let (x, y) = (index % picture.width as usize, index / picture.width as usize);
            let found = format!("the colour {} at ({x}, {y})", picture.texels[index]);
            Err(Error::unexpected(Place::file(path), found, format!("finite numbers of at most {most:e}")))
        }
    }
}

/// Reads an OpenEXR or Radiance file; `None` of another kind, which its first bytes tell.
fn read_linear(path: &Path, named_by: &Place) -> Result<Option<Picture<Vec3>>, Error> {
    let mut magic = Vec::new();
    open(path, Some(named_by))?
        .take(4)
        .read_to_end(&mut magic)
        .map_err(|source| Error::read(path, Some(named_by), source))?;
    match magic.as_slice() {
        [0x76, 0x2f, 0x31, 0x01] => read_exr(path).map(Some),
        b"#?RA" | b"#?RG" => read_radiance(path, named_by).map(Some),
        _ => Ok(None),
    }
}

/// Refuses sizes that are empty or absurd.
fn check_size(path: &Path, width: u64, height: u64) -> Result<(), Error> {
    let bytes = fs::metadata(path).map_err(|source| Error::read(path, None, source))?.len();
    let most = MOST_TEXELS.min(FREE_TEXELS + TEXELS_PER_BYTE.saturating_mul(bytes));
    if width >= 1 && height >= 1 && width.saturating_mul(height) <= most {
        return Ok(());
    }
    let expected = format!("at least one texel and at most {most} in a file of {bytes} bytes");
    Err(Error::unexpected(Place::file(path), format!("an image of {width} × {height} texels"), expected))
}

/// Reads a PNG, JPEG, TGA or BMP as it is.
fn read_image(path: &Path, named_by: &Place) -> Result<DynamicImage, Error> {
    let unreadable = |source| Error::read(path, Some(named_by), source);
    let broken = |error: ImageError| {
        let what =
            if matches!(error, ImageError::Unsupported(_)) { "a file of another kind" } else { "a broken image" };
        let expected = "a PNG, JPEG, TGA, BMP, OpenEXR or Radiance image";
        Error::unexpected(Place::file(path), format!("{what} ({error})"), expected)
    };
    let open = || ImageReader::open(path).and_then(ImageReader::with_guessed_format).map_err(unreadable);
    let (width, height) = open()?.into_dimensions().map_err(broken)?;
    check_size(path, width.into(), height.into())?;

    let mut reader = open()?;
    let mut limits = image::Limits::default();
    limits.max_alloc = Some(8 * MOST_TEXELS);
    reader.limits(limits);
    reader.decode().map_err(broken)
}

/// The colours of an image, `number` telling what a code stands for, both in [0, 1].
fn of_codes(image: DynamicImage, number: fn(f32) -> f32) -> Picture<[f16; 4]> {
    let image = image.into_rgb16();
    let (width, height) = image.dimensions();
    let linear: Vec<f16> = (0..=u16::MAX).map(|code| f16::from_f32(number(f32::from(code) / 65535.0))).collect();
    let texels = image.pixels().map(|pixel| {
        let [red, green, blue] = pixel.0.map(|code| linear[usize::from(code)]);
        [red, green, blue, f16::ONE]
    });
    Picture { width, height, texels: texels.collect() }
}

/// A texture of numbers that are shares of 1, clamped with a warning.
fn shares(path: &Path, mut picture: Picture<Vec3>, warnings: &mut Vec<Warning>) -> Result<Texture, Error> {
    check_texels(path, &picture, f32::MAX)?;
    let clamped = change(&mut picture, |color| color.clamp(Vec3::ZERO, Vec3::ONE));
    if clamped > 0 {
        let message = format!("{clamped} texels lie outside of [0, 1]: clamped, as nothing reflects more than it gets");
        warnings.push(Warning { place: Place::file(path), message });
    }
    let texels = picture.texels.iter().map(|color| color.extend(1.0).to_array().map(f16::from_f32));
    Ok(of_picture(path, Picture { width: picture.width, height: picture.height, texels: texels.collect() }))
}

/// The decoding function of IEC 61966-2-1.
fn srgb_to_linear(code: f32) -> f32 {
    if code <= 0.04045 { code / 12.92 } else { ((code + 0.055) / 1.055).powf(2.4) }
}

/// Reads the channels R, G and B of an OpenEXR file's first layer that has them.
fn read_exr(path: &Path) -> Result<Picture<Vec3>, Error> {
    let broken = |error: exr::error::Error| {
        let found = format!("a broken image ({error})");
        Error::unexpected(Place::file(path), found, "an OpenEXR image with the channels R, G and B")
    };
    let headers = exr::meta::MetaData::read_from_file(path, false).map_err(broken)?.headers;
    for header in &headers {
        check_size(path, header.layer_size.width() as u64, header.layer_size.height() as u64)?;
    }
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .rgb_channels(
            |size, _| (size, vec![Vec3::ZERO; size.area()]),
            |(size, colors), at, (red, green, blue): (f32, f32, f32)| {
                colors[at.y() * size.width() + at.x()] = Vec3::new(red, green, blue);
            },
        )
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_file(path)
        .map_err(broken)?;
    let (size, texels) = image.layer_data.channel_data.pixels;
    Ok(Picture { width: size.width() as u32, height: size.height() as u32, texels })
}

/// Reads a Radiance file (`#?RADIANCE` or `#?RGBE`) as it is written, whatever its `EXPOSURE`.
fn read_radiance(path: &Path, named_by: &Place) -> Result<Picture<Vec3>, Error> {
    let error = |found| Error::unexpected(Place::file(path), found, "a Radiance image (32-bit_rle_rgbe)");
    let broken = |reason: ImageError| error(format!("a broken image ({reason})"));
    let file = || open(path, Some(named_by));
    // The decoder would take a line of any length.
    let mut start = Vec::new();
    let read = file()?.take(LONGEST_HEADER).read_to_end(&mut start);
    read.map_err(|source| Error::read(path, Some(named_by), source))?;
    let end = start.windows(2).position(|pair| pair == b"\n\n");
    if !end.is_some_and(|end| start[end + 2..].contains(&b'\n')) {
        return Err(error(format!("no end of the header in the first {} KiB", LONGEST_HEADER >> 10)));
    }
    let decoder = HdrDecoder::new_nonstrict(BufReader::new(file()?)).map_err(broken)?;
    let (width, height) = decoder.dimensions();
    check_size(path, width.into(), height.into())?;
    let mut texels = vec![Vec3::ZERO; width as usize * height as usize];
    decoder.read_image(bytemuck::cast_slice_mut(&mut texels)).map_err(broken)?;
    Ok(Picture { width, height, texels })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_codes_decode_to_the_standards_values() {
        for (code, linear) in [(0.0, 0.0), (0.04045, 0.0031308), (0.5, 0.2140411), (1.0, 1.0)] {
            assert!((srgb_to_linear(code) - linear).abs() < 1e-6);
        }
    }
}
