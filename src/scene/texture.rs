//! Textures: linear RGB at half precision, sampled bilinearly, repeated in both directions.

use std::sync::Arc;

use glam::{Vec2, Vec3};
use half::f16;

/// An image over (u, v), v up: texel (0, 0) is the image's upper left one.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// For messages.
    pub name: String,
    /// Texels across, ≥ 1.
    pub width: u32,
    /// Texels down, ≥ 1.
    pub height: u32,
    /// `width × height` linear Rec. 709 texels, row by row from the top; the fourth number is 1. Textures that place one image in several
    /// ways share them.
    pub texels: Arc<Vec<[f16; 4]>>,
    /// Where it lies.
    pub placement: TexturePlacement,
}

/// Where a texture lies on a surface: at texture coordinates (u, v) it is looked up at offset + scale · (u, v).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TexturePlacement {
    /// How often it is repeated from 0 to 1; mirrored where it is negative.
    pub scale: Vec2,
    /// In widths and heights of the texture.
    pub offset: Vec2,
}

impl TexturePlacement {
    /// Largest number that a file may place a texture by.
    pub const LARGEST: f32 = 1e6;
}

impl Default for TexturePlacement {
    /// Once from 0 to 1.
    fn default() -> TexturePlacement {
        TexturePlacement { scale: Vec2::ONE, offset: Vec2::ZERO }
    }
}

impl Texture {
    /// Of whole rows of texels, where it lies unless somebody places it.
    pub fn new(name: impl Into<String>, width: u32, texels: Vec<[f16; 4]>) -> Texture {
        let height = texels.len() as u32 / width.max(1);
        Texture { name: name.into(), width, height, texels: Arc::new(texels), placement: TexturePlacement::default() }
    }

    /// Whether nearly all texels are unit vectors that point outwards, each component from −1 (0 in the texture) to 1, and not grey.
    pub fn holds_normals(&self) -> bool {
        let is_normal = |[x, y, z, _]: &[f16; 4]| {
            let normal = 2.0 * Vec3::new(x.to_f32(), y.to_f32(), z.to_f32()) - 1.0;
            normal.z > 0.0 && x != z && (normal.length() - 1.0).abs() < 0.1
        };
        let count = self.texels.iter().filter(|texel| is_normal(texel)).count();
        10 * count >= 9 * self.texels.len()
    }

    /// The normals of a surface of heights (the mean of a texel's colour): from 0 at black to `highest` at white, in texels. By central differences.
    pub fn normals_of_heights(&self, highest: f32) -> Texture {
        let [width, height] = [self.width as usize, self.height as usize];
        let at = |x: usize, y: usize| {
            let [red, green, blue, _] = self.texels[y % height * width + x % width].map(f16::to_f32);
            highest * (red + green + blue) / 3.0
        };
        let texels = (0..width * height).map(|index| {
            let (x, y) = (index % width, index / width);
            let along_u = (at(x + 1, y) - at(x + width - 1, y)) / 2.0;
            // Rows run down, v up.
            let along_v = (at(x, y + height - 1) - at(x, y + 1)) / 2.0;
            let normal = Vec3::new(-along_u, -along_v, 1.0).normalize();
            (0.5 + 0.5 * normal).extend(1.0).to_array().map(f16::from_f32)
        });
        Texture { texels: Arc::new(texels.collect()), ..self.clone() }
    }

    /// The bilinearly interpolated colour at a surface's texture coordinate (texel centres at half-integers).
    pub fn sample(&self, uv: Vec2) -> Vec3 {
        let TexturePlacement { scale, offset } = self.placement;
        let uv = offset + scale * uv;
        let size = Vec2::new(self.width as f32, self.height as f32);
        let wrapped = uv - uv.floor();
        let position = Vec2::new(wrapped.x, 1.0 - wrapped.y) * size - 0.5;
        let corner = position.floor();
        let fraction = position - corner;
        let texel = |dx: i32, dy: i32| {
            let x = (corner.x as i32 + dx).rem_euclid(self.width as i32) as usize;
            let y = (corner.y as i32 + dy).rem_euclid(self.height as i32) as usize;
            let [red, green, blue, _] = self.texels[y * self.width as usize + x];
            Vec3::new(red.to_f32(), green.to_f32(), blue.to_f32())
        };
        let upper = texel(0, 0).lerp(texel(1, 0), fraction.x);
        let lower = texel(0, 1).lerp(texel(1, 1), fraction.x);
        upper.lerp(lower, fraction.y)
    }

    /// The same of a map of normals: x along the surface's u, y along its v, from −1 (0 in the texture) to 1, also where it is mirrored.
    pub fn sample_normal(&self, uv: Vec2) -> Vec3 {
        let color = self.sample(uv);
        let is_mirrored = self.placement.scale.cmplt(Vec2::ZERO);
        Vec2::select(is_mirrored, 1.0 - color.truncate(), color.truncate()).extend(color.z)
    }

    /// The same of what [`Texture::of_doubled_angles`] made: cos 2ψ and sin 2ψ of the surface's u and v, also where it is mirrored.
    pub fn sample_doubled_angle(&self, uv: Vec2) -> Vec2 {
        let Vec2 { x: cos, y: sin } = self.sample(uv).truncate();
        let is_mirrored = self.placement.scale.x * self.placement.scale.y < 0.0;
        Vec2::new(cos, if is_mirrored { -sin } else { sin })
    }

    /// A texture of directions d, (d + 1) / 2 in red and green, as the cosine and sine of twice their angle ψ: d and −d are the same, and what lies
    /// between texels is between them. Where there is no direction it is that of u.
    pub fn of_doubled_angles(self) -> Texture {
        let doubled = |[red, green, ..]: &[f16; 4]| {
            let d = 2.0 * Vec2::new(red.to_f32(), green.to_f32()) - 1.0;
            let squared = d.length_squared();
            let doubled = Vec2::new(d.x * d.x - d.y * d.y, 2.0 * d.x * d.y) / squared;
            let doubled = if squared < 0.01 { Vec2::X } else { doubled };
            [doubled.x, doubled.y, 0.0, 1.0].map(f16::from_f32)
        };
        Texture { texels: Arc::new(self.texels.iter().map(doubled).collect()), ..self }
    }
}
