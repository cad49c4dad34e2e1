//! Light sampling: one light by power, a point or direction on it uniformly.
//!
//! The powers are those of [`LightTable`](crate::scene::LightTable), computed here once more; the densities are its
//! closed forms.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

use super::luminance;
use super::random::Random;
use super::surface::Placement;
use crate::scene::{Material, Scene};

/// All lights of a scene.
pub struct Lights {
    triangles: Vec<EmissiveTriangle>,
    /// The power of each light and all before it: triangles, texels, sun.
    cumulated: Vec<f64>,
    /// πR², R the radius of the scene: what distant light falls on.
    disk: f64,
}

struct EmissiveTriangle {
    corner: DVec3,
    edge1: DVec3,
    edge2: DVec3,
    /// Unit, of the front.
    normal: DVec3,
    /// How far off any point of it may be.
    error: DVec3,
    radiance: DVec3,
    both_sides: bool,
    /// [`area_weight`] of its material.
    weight: f64,
}

/// Light that may arrive from somewhere.
pub struct LightSample {
    /// Where from.
    pub source: Source,
    /// If nothing is in between; for a [`Source::Direction`] that is a delta, irradiance.
    pub radiance: DVec3,
    /// Per unit solid angle; the probability of the light where `is_delta`.
    pub pdf: f64,
    /// No BSDF sample can find it.
    pub is_delta: bool,
}

/// Where light comes from.
pub enum Source {
    /// A point on a surface.
    Point {
        /// World space.
        position: DVec3,
        /// How far off it may be.
        error: DVec3,
        /// Unit.
        normal: DVec3,
    },
    /// Infinitely far away; the unit vector towards it.
    Direction(DVec3),
}

/// Power of an emitter per unit area: π·Y·sides.
fn area_weight(material: &Material) -> f64 {
    let sides = if material.emits_both_sides { 2.0 } else { 1.0 };
    PI * luminance(material.emission.as_dvec3()) * sides
}

impl Lights {
    /// Finds them.
    pub fn new(scene: &Scene, placements: &[Placement]) -> Lights {
        let mut triangles = Vec::new();
        for (instance, placement) in scene.instances.iter().zip(placements) {
            let mesh = &scene.meshes[instance.mesh as usize];
            if !mesh.materials.iter().any(|material| scene.materials[*material as usize].is_emissive()) {
                continue;
            }
            for triangle in 0..mesh.triangles.len() {
                let material = &scene.materials[mesh.material(triangle) as usize];
                if material.is_emissive() {
                    triangles.extend(EmissiveTriangle::new(
                        mesh.corners(triangle).map(|corner| corner.as_dvec3()),
                        placement,
                        material,
                    ));
                }
            }
        }

        let disk = PI * f64::from(scene.bounds().radius()).powi(2);
        let mut powers: Vec<f64> = triangles.iter().map(|triangle| triangle.weight * triangle.area()).collect();
        if let Some(sky) = &scene.environment {
            for (row, texels) in sky.texels.chunks_exact(sky.width as usize).enumerate() {
                let weight = disk * sky.solid_angle(row as u32);
                powers.extend(texels.iter().map(|radiance| weight * luminance(radiance.as_dvec3())));
            }
        }
        powers.extend(scene.sun.map(|sun| disk * luminance(sun.irradiance.as_dvec3())));

        let cumulated = powers
            .iter()
            .scan(0.0, |sum, power| {
                *sum += power;
                Some(*sum)
            })
            .collect();
        Lights { triangles, cumulated, disk }
    }

    fn total_power(&self) -> f64 {
        self.cumulated.last().copied().unwrap_or(0.0)
    }

    /// Picks light for a point; `None` where it picks a back, or there is no light.
    pub fn sample(&self, scene: &Scene, point: DVec3, random: &mut Random) -> Option<LightSample> {
        let total = self.total_power();
        if total <= 0.0 {
            return None;
        }
        let target = random.uniform() * total;
        let index = self.cumulated.partition_point(|sum| *sum <= target).min(self.cumulated.len() - 1);
        let u = DVec2::new(random.uniform(), random.uniform());

        if let Some(triangle) = self.triangles.get(index) {
            let root = u.x.sqrt();
            let position = triangle.corner + (root * (1.0 - u.y)) * triangle.edge1 + (root * u.y) * triangle.edge2;
            let to_light = position - point;
            let distance_squared = to_light.length_squared();
            let cosine = -to_light.dot(triangle.normal) / distance_squared.sqrt();
            if !(cosine > 0.0 || triangle.both_sides && cosine < 0.0) {
                return None;
            }
            return Some(LightSample {
                source: Source::Point { position, error: triangle.error, normal: triangle.normal },
                radiance: triangle.radiance,
                pdf: triangle.weight / total * distance_squared / cosine.abs(),
                is_delta: false,
            });
        }

        let texel = index - self.triangles.len();
        if let Some(sky) = &scene.environment
            && let Some(radiance) = sky.texels.get(texel)
        {
            let (column, row) = (texel as u32 % sky.width, texel as u32 / sky.width);
            let radiance = radiance.as_dvec3();
            return Some(LightSample {
                source: Source::Direction(sky.direction([column, row], u)),
                radiance,
                pdf: self.disk * luminance(radiance) / total,
                is_delta: false,
            });
        }

        let sun = scene.sun?;
        let irradiance = sun.irradiance.as_dvec3();
        Some(LightSample {
            source: Source::Direction(sun.direction.as_dvec3().normalize()),
            radiance: irradiance,
            pdf: self.disk * luminance(irradiance) / total,
            is_delta: true,
        })
    }

    /// The density, per unit solid angle, with which [`Lights::sample`] picks a point of an emitter that is seen at an angle of
    /// `cosine` to its normal.
    pub fn emitter_pdf(&self, material: &Material, distance_squared: f64, cosine: f64) -> f64 {
        area_weight(material) / self.total_power() * distance_squared / cosine.abs()
    }

    /// The density, per unit solid angle, with which [`Lights::sample`] picks a direction that `radiance` comes from.
    pub fn environment_pdf(&self, radiance: DVec3) -> f64 {
        if self.total_power() > 0.0 { self.disk * luminance(radiance) / self.total_power() } else { 0.0 }
    }
}

impl EmissiveTriangle {
    /// `None` without area: a ray never hits it.
    fn new(corners: [DVec3; 3], placement: &Placement, material: &Material) -> Option<EmissiveTriangle> {
        let [v0, v1, v2] = corners;
        let normal = placement.normal((v1 - v0).cross(v2 - v0)).try_normalize()?;
        let [p0, p1, p2] = corners.map(|corner| placement.point(corner));
        Some(EmissiveTriangle {
            corner: p0,
            edge1: p1 - p0,
            edge2: p2 - p0,
            normal,
            error: placement.error_bound(v0.abs().max(v1.abs()).max(v2.abs())),
            radiance: material.emission.as_dvec3(),
            both_sides: material.emits_both_sides,
            weight: area_weight(material),
        })
    }

    fn area(&self) -> f64 {
        self.edge1.cross(self.edge2).length() / 2.0
    }
}
