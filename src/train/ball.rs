//! A ball under small lights, lit directly: what a fit is judged by.

use std::f64::consts::PI;

use glam::{DVec2, DVec3, Vec3};
use nv_flip::{FlipImageRgb8, FlipPool};

use super::measure::{EvalAt, Query};
use crate::image::tone_map;
use crate::scene::brdf::Footprint;

/// Lights around the viewer's hemisphere and somewhat beyond.
const LIGHTS: usize = 76;

/// Radiance of a ball, seen from infinitely far away along +z, square, row by row from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Ball {
    /// Pixels to a side.
    pub size: usize,
    /// Linear RGB, 0 beside the ball.
    pub pixels: Vec<[f32; 3]>,
}

impl Ball {
    /// Renders: point lights at the points of a Fibonacci spiral, so bright that a white matte ball has about 1 at its brightest. The
    /// tangent runs eastwards about the vertical axis. The texture of a material that varies covers the square.
    pub fn render(size: usize, eval: EvalAt) -> Ball {
        let lights: Vec<DVec3> = (0..LIGHTS)
            .map(|i| {
                let z = 1.0 - 1.3 * (i as f64 + 0.5) / LIGHTS as f64;
                let phi = i as f64 * PI * (3.0 - 5.0f64.sqrt());
                let rho = (1.0 - z * z).sqrt();
                DVec3::new(rho * phi.cos(), rho * phi.sin(), z)
            })
            .collect();
        let irradiance = PI / lights.iter().map(|light| light.z.max(0.0)).sum::<f64>();
        let mut pixels = vec![[0.0; 3]; size * size];
        let mut queries = Vec::new();
        let mut places = Vec::new();
        for (place, normal) in (0..size * size).filter_map(|place| Some((place, normal(size, place)?))) {
            let tangent = DVec3::Y.cross(normal).normalize_or(DVec3::X);
            let bitangent = normal.cross(tangent);
            let local = |w: DVec3| DVec3::new(w.dot(tangent), w.dot(bitangent), w.dot(normal));
            let wo = local(DVec3::Z);
            let uv = DVec2::new((place % size) as f64 + 0.5, (size - 1 - place / size) as f64 + 0.5) / size as f64;
            for wi in lights.iter().map(|light| local(*light)).filter(|wi| wi.z > 1e-3) {
                queries.push(Query { footprint: Footprint::point(uv), wo, wi });
                places.push((place, (wi.z * irradiance) as f32));
            }
        }
        for (value, (place, factor)) in eval(&queries).into_iter().zip(places) {
            let lit = Vec3::from(pixels[place]) + factor * value.as_vec3();
            pixels[place] = lit.to_array();
        }
        Ball { size, pixels }
    }

    /// Tone-mapped sRGB, 8 bits a channel.
    pub fn srgb(&self) -> Vec<u8> {
        tone_map::to_srgb8(&self.pixels, 0.0)
    }

    /// Structural similarity to another ball (Wang et al. 2004: Gaussian windows of 11 × 11 pixels, σ = 1.5) of what is shown
    /// in 8 bits, mean over channels and over the pixels of the ball; the black around it does not count.
    pub fn ssim(&self, other: &Ball) -> f64 {
        let [a, b] = [self, other].map(|ball| ball.srgb());
        let size = self.size;
        let kernel: Vec<f64> = (-5..=5).map(|x: i32| (-f64::from(x * x) / 4.5).exp()).collect();
        let (mut total, mut count) = (0.0, 0usize);
        for place in (0..size * size).filter(|place| normal(size, *place).is_some()) {
            for channel in 0..3 {
                let (mut weight, mut sums) = (0.0, [0.0; 5]);
                for (j, wy) in kernel.iter().enumerate() {
                    for (i, wx) in kernel.iter().enumerate() {
                        let (x, y) = ((place % size + i) as i64 - 5, (place / size + j) as i64 - 5);
                        if x < 0 || y < 0 || x >= size as i64 || y >= size as i64 {
                            continue;
                        }
                        let at = (y as usize * size + x as usize) * 3 + channel;
                        let (p, q, w) = (f64::from(a[at]), f64::from(b[at]), wx * wy);
                        weight += w;
                        [p, q, p * p, q * q, p * q].into_iter().zip(&mut sums).for_each(|(v, sum)| *sum += w * v);
                    }
                }
                let [p, q, pp, qq, pq] = sums.map(|sum| sum / weight);
                let (c1, c2) = ((0.01f64 * 255.0).powi(2), (0.03f64 * 255.0).powi(2));
                total += (2.0 * p * q + c1) * (2.0 * (pq - p * q) + c2)
                    / ((p * p + q * q + c1) * (pp - p * p + qq - q * q + c2));
                count += 1;
            }
        }
        total / count.max(1) as f64
    }

    /// Mean ꟻLIP error (Andersson et al. 2020, LDR) of what is shown, over the whole square.
    pub fn flip(&self, truth: &Ball) -> f64 {
        let [image, reference] =
            [self, truth].map(|ball| FlipImageRgb8::with_data(ball.size as u32, ball.size as u32, &ball.srgb()));
        let error = nv_flip::flip(reference, image, nv_flip::DEFAULT_PIXELS_PER_DEGREE);
        f64::from(FlipPool::from_image(&error).mean())
    }

    /// Peak signal-to-noise ratio of what is shown, dB, over the pixels of the ball.
    pub fn psnr(&self, other: &Ball) -> f64 {
        let [a, b] = [self, other].map(|ball| ball.srgb());
        let inside = |place: &usize| normal(self.size, *place / 3).is_some();
        let errors: Vec<f64> =
            (0..a.len()).filter(inside).map(|i| (f64::from(a[i]) - f64::from(b[i])).powi(2)).collect();
        let mse = errors.iter().sum::<f64>() / errors.len().max(1) as f64;
        10.0 * (255.0f64.powi(2) / mse.max(1e-9)).log10()
    }
}

/// The ball's normal at a pixel.
fn normal(size: usize, place: usize) -> Option<DVec3> {
    let at = |i: usize| (2.0 * (i as f64 + 0.5) / size as f64 - 1.0) * 1.02;
    let (x, y) = (at(place % size), -at(place / size));
    let z = 1.0 - x * x - y * y;
    (z > 1e-4).then(|| DVec3::new(x, y, z.sqrt()))
}
