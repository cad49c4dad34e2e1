//! Where a frame goes.

use crate::gpu::{HostBuffer, HostImage};

/// What is written of each pixel: red, green and blue of Rec. 709's primaries, and an alpha of 1. Rows run from the top, without gaps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum PixelFormat {
    /// Linear, four `f32`: for `VK_FORMAT_R32G32B32A32_SFLOAT`.
    Rgba32Float = 0,
    /// Linear, four `f16`, at most 65504: for `VK_FORMAT_R16G16B16A16_SFLOAT`.
    Rgba16Float = 1,
    /// To look at: exposed, tone-mapped (Khronos PBR Neutral) and sRGB-encoded bytes: for `VK_FORMAT_R8G8B8A8_UNORM` and
    /// `_SRGB`, whose bytes are the same.
    Rgba8 = 2,
    /// The same, blue first, as swapchains have it: for `VK_FORMAT_B8G8R8A8_UNORM` and `_SRGB`.
    Bgra8 = 3,
}

/// What of the film is written. All but the first need [`Settings::features`](crate::render::Settings::features).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum Channel {
    /// Mean radiance so far.
    #[default]
    Beauty = 0,
    /// Mean albedo of what is seen first; 0 where nothing is.
    Albedo = 1,
    /// Mean shading normal of what is seen first, world space, facing the viewer; 0 where nothing is.
    Normal = 2,
    /// Distance along the camera's axis of what each pixel's centre sees, in red, green and blue; infinite where nothing is, 65504 in `f16`.
    Depth = 3,
}

/// A host's memory that a frame is written to.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    /// The memory.
    pub place: Place,
    /// How pixels are written.
    pub format: PixelFormat,
    /// What is written.
    pub channel: Channel,
    /// 8-bit formats show radiance · 2^exposure.
    pub exposure: f32,
}

/// An image or a buffer.
#[derive(Clone, Copy, Debug)]
pub enum Place {
    /// An image, as large as the renderer's film from its origin on.
    Image(HostImage),
    /// A buffer with room for the film's pixels.
    Buffer(HostBuffer),
}

impl Target {
    /// The beauty, to an image.
    pub fn image(image: HostImage, format: PixelFormat) -> Target {
        Target { place: Place::Image(image), format, channel: Channel::Beauty, exposure: 0.0 }
    }

    /// The beauty, to a buffer.
    pub fn buffer(buffer: HostBuffer, format: PixelFormat) -> Target {
        Target { place: Place::Buffer(buffer), format, channel: Channel::Beauty, exposure: 0.0 }
    }
}

impl PixelFormat {
    /// Bytes of a pixel.
    pub fn bytes(self) -> u32 {
        match self {
            PixelFormat::Rgba32Float => 16,
            PixelFormat::Rgba16Float => 8,
            PixelFormat::Rgba8 | PixelFormat::Bgra8 => 4,
        }
    }
}

impl Channel {
    /// Its name in lower case.
    pub fn name(self) -> &'static str {
        match self {
            Channel::Beauty => "beauty",
            Channel::Albedo => "albedo",
            Channel::Normal => "normal",
            Channel::Depth => "depth",
        }
    }
}
