//! Structs that host and kernels share: declared once in `glsl/layout` (or a kernel) and once here, by
//! [`shared_structs!`](crate::shared_structs). `tests/layout.rs` compares the two, member by member, in the compiled SPIR-V.

/// Where a struct's members lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StructLayout {
    /// Its name, in Rust as in GLSL.
    pub name: &'static str,
    /// Its bytes, and the stride of an array of it.
    pub size: usize,
    /// Its members in order.
    pub members: &'static [Member],
}

/// A member of a struct.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Member {
    /// Its name, in Rust as in GLSL.
    pub name: &'static str,
    /// Its first byte.
    pub offset: usize,
    /// Its bytes.
    pub size: usize,
}

/// Declares `#[repr(C)]`, [`Pod`](bytemuck::Pod) structs that mirror those of GLSL (`layout(scalar)`), and a list of
/// their layouts for the test.
///
/// A struct and its members are named as in GLSL: for a push constant block or a buffer reference that is the block's
/// name. A buffer reference is a `u64` here. Padding, where alignment needs any, is a member in both. A buffer reference of
/// nothing but an unsized array needs no struct of its own, only one for its element.
///
/// ```
/// neubrdf::shared_structs! {
///     /// What glsl/layout/ray.glsl declares.
///     pub const RAY_STRUCTS;
///
///     /// `struct Ray { vec3 origin; float t_max; };`
///     pub struct Ray {
///         pub origin: [f32; 3],
///         pub t_max: f32,
///     }
/// }
/// assert_eq!(RAY_STRUCTS[0].members[1].offset, 12);
/// ```
#[macro_export]
macro_rules! shared_structs {
    (
        $(#[$list_attribute:meta])* $list_visibility:vis const $list:ident;
        $(
            $(#[$attribute:meta])*
            $visibility:vis struct $name:ident {
                $($(#[$member_attribute:meta])* $member_visibility:vis $member:ident: $type:ty),* $(,)?
            }
        )*
    ) => {
        $(#[$list_attribute])*
        $list_visibility const $list: &[$crate::gpu::layout::StructLayout] = &[$(
            $crate::gpu::layout::StructLayout {
                name: stringify!($name),
                size: ::core::mem::size_of::<$name>(),
                members: &[$($crate::gpu::layout::Member {
                    name: stringify!($member),
                    offset: ::core::mem::offset_of!($name, $member),
                    size: ::core::mem::size_of::<$type>(),
                }),*],
            }
        ),*];
        $(
            $(#[$attribute])*
            #[repr(C)]
            #[derive(Clone, Copy, Debug, ::bytemuck::Pod, ::bytemuck::Zeroable)]
            $visibility struct $name {
                $($(#[$member_attribute])* $member_visibility $member: $type),*
            }
        )*
    };
}
