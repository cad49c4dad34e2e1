//! Surfaces with maps, made up.

use std::f32::consts::TAU;

use glam::{Vec2, Vec3};
use half::f16;
use neubrdf::scene::{Color, Fresnel, Surface, SurfaceMaps, Texture};

/// A texture of a function of (u, v) at the centres of its texels.
pub fn texture(side: u32, color: impl Fn(Vec2) -> Vec3) -> Texture {
    let texels = (0..side * side).map(|i| {
        let at = Vec2::new((i % side) as f32 + 0.5, side as f32 - 0.5 - (i / side) as f32) / side as f32;
        color(at).extend(1.0).to_array().map(f16::from_f32)
    });
    Texture::new("made", side, texels.collect())
}

/// Tiles of four colours of metal with grout between them, matte there and smooth on the tiles; `bumps` lets them bulge.
pub fn tiles(side: u32, bumps: f32) -> SurfaceMaps {
    // How far a place is from the border of its tile, in [0, 1].
    let inside = |at: Vec2| 1.0 - (2.0 * (2.0 * at).fract() - 1.0).abs().max_element();
    let is_grout = move |at: Vec2| inside(at) < 0.15;
    let color = texture(side, |at| {
        let tile = (2.0 * at).floor();
        let tint = Vec3::new(0.3 + 0.6 * tile.x, 0.8 - 0.5 * tile.y, 0.3 + 0.5 * (tile.x - tile.y).abs());
        if is_grout(at) { Vec3::splat(0.15) } else { tint }
    });
    let roughness = texture(side, |at| Vec3::splat(if is_grout(at) { 0.9 } else { 0.4 + 0.2 * (2.0 * at).fract().x }));
    let normal = (bumps > 0.0).then(|| {
        texture(side, |at| {
            let slope = bumps * Vec2::new((TAU * 2.0 * at.x).cos(), (TAU * 2.0 * at.y).cos());
            0.5 * slope.extend(1.0).normalize() + 0.5
        })
    });
    let fresnel = Fresnel::Schlick { f0: Color::constant(Vec3::ONE) };
    SurfaceMaps {
        surface: Surface::Conductor { fresnel, alpha: Vec2::ONE },
        color: Some(color),
        roughness: Some(roughness),
        normal,
        direction: None,
    }
}
