//! The structs of `glsl/layout/develop.glsl`, which says what the members mean.
#![allow(missing_docs)]

crate::shared_structs! {
    /// The structs of the kernel that develops the film.
    pub const DEVELOP_STRUCTS;

    /// Push constants.
    pub struct DevelopPass {
        pub pixels: u64,
        pub features: u64,
        pub packed_pixels: u64,
        pub pixel_count: u32,
        pub sample_count: u32,
        pub channel: u32,
        pub format: u32,
        pub exposure: f32,
        pub padding: u32,
    }
}
