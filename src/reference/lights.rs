//! Light sampling: one of the kinds of light that the scene has, one light of it by power, a point or direction on that
//! uniformly. Other densities than those of [`LightTable`](crate::scene::LightTable), which has a tree of lamps and leaves what of a sky
//! is no brighter than its mean to the BSDF: what they agree on is the expectation.

use glam::{DVec2, DVec3};

use super::luminance;
use super::random::Random;
use super::surface::Placement;
use crate::scene::{Material, Scene};

/// All lights of a scene.
pub struct Lights {
    triangles: Vec<EmissiveTriangle>,
    /// The power, over π, of each triangle and all before it.
    emitted: Vec<f64>,
    /// The luminance times solid angle of each texel and all before it.
    from_sky: Vec<f64>,
    /// Those that shine.
    kinds: Vec<Kind>,
    /// [`area_weight`] of each material.
    weights: Vec<f64>,
}

#[derive(Clone, Copy)]
enum Kind {
    Emitters,
    Sky,
    Sun,
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
    /// A texture that multiplies it, and texture coordinates of the corners.
    texture: Option<(u32, [DVec2; 3])>,
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

/// Power of an emitter per unit area, over π: Y·sides, with a texture's mean.
fn area_weight(material: &Material, scene: &Scene) -> f64 {
    let sides = if material.emits_both_sides { 2.0 } else { 1.0 };
    let mean = material.emission_texture.map_or(DVec3::ONE, |texture| {
        let texels = &scene.textures[texture as usize].texels;
        let sum: DVec3 = texels.iter().map(|[r, g, b, _]| DVec3::new(r.to_f64(), g.to_f64(), b.to_f64())).sum();
        sum / texels.len() as f64
    });
    luminance(material.emission.as_dvec3() * mean) * sides
}

fn cumulated(weights: impl Iterator<Item = f64>) -> Vec<f64> {
    weights
        .scan(0.0, |sum, weight| {
            *sum += weight;
            Some(*sum)
        })
        .collect()
}

/// Index of the weight that u in [0, 1) falls on.
fn pick(cumulated: &[f64], u: f64) -> usize {
    let target = u * total(cumulated);
    cumulated.partition_point(|sum| *sum <= target).min(cumulated.len() - 1)
}

fn total(cumulated: &[f64]) -> f64 {
    cumulated.last().copied().unwrap_or(0.0)
}

impl Lights {
    /// Finds them.
    pub fn new(scene: &Scene, placements: &[Placement]) -> Lights {
        let weights: Vec<f64> = scene.materials.iter().map(|material| area_weight(material, scene)).collect();
        let mut triangles = Vec::new();
        for (instance, placement) in scene.instances.iter().zip(placements) {
            let mesh = &scene.meshes[instance.mesh as usize];
            if !mesh.materials.iter().any(|material| scene.materials[*material as usize].is_emissive()) {
                continue;
            }
            for triangle in 0..mesh.triangles.len() {
                let index = mesh.material(triangle) as usize;
                let material = &scene.materials[index];
                if material.is_emissive() {
                    let corners = mesh.corners(triangle).map(|corner| corner.as_dvec3());
                    let uvs = mesh.corner_uvs(triangle).map(|uv| uv.as_dvec2());
                    triangles.extend(EmissiveTriangle::new(corners, uvs, placement, material, weights[index]));
                }
            }
        }

        let emitted = cumulated(triangles.iter().map(|triangle| triangle.weight * triangle.area()));
        let from_sky = cumulated(scene.environment.iter().flat_map(|sky| {
            sky.texels
                .iter()
                .enumerate()
                .map(|(texel, radiance)| sky.solid_angle(texel as u32 / sky.width) * luminance(radiance.as_dvec3()))
        }));
        let sun = scene.sun.map_or(0.0, |sun| luminance(sun.irradiance.as_dvec3()));
        let by_kind = [(Kind::Emitters, total(&emitted)), (Kind::Sky, total(&from_sky)), (Kind::Sun, sun)];
        let kinds = by_kind.into_iter().filter(|(_, weight)| *weight > 0.0).map(|(kind, _)| kind).collect();
        Lights { triangles, emitted, from_sky, kinds, weights }
    }

    /// Of the samples, that each kind gets.
    fn share(&self) -> f64 {
        1.0 / self.kinds.len() as f64
    }

    /// Picks light for a point; `None` where it picks a back, or there is no light.
    pub fn sample(&self, scene: &Scene, point: DVec3, random: &mut Random) -> Option<LightSample> {
        let kind = *self.kinds.get((random.uniform() * self.kinds.len() as f64) as usize)?;
        match kind {
            Kind::Emitters => self.sample_emitter(scene, point, random),
            Kind::Sky => self.sample_sky(scene, random),
            Kind::Sun => scene.sun.map(|sun| LightSample {
                source: Source::Direction(sun.direction.as_dvec3().normalize()),
                radiance: sun.irradiance.as_dvec3(),
                pdf: self.share(),
                is_delta: true,
            }),
        }
    }

    fn sample_emitter(&self, scene: &Scene, point: DVec3, random: &mut Random) -> Option<LightSample> {
        let triangle = &self.triangles[pick(&self.emitted, random.uniform())];
        let u = DVec2::new(random.uniform(), random.uniform());
        let root = u.x.sqrt();
        let weights = [1.0 - root, root * (1.0 - u.y), root * u.y];
        let position = triangle.corner + weights[1] * triangle.edge1 + weights[2] * triangle.edge2;
        let share = triangle.texture.map_or(DVec3::ONE, |(texture, uvs)| {
            let uv: DVec2 = uvs.iter().zip(weights).map(|(uv, weight)| weight * *uv).sum();
            scene.textures[texture as usize].sample(uv.as_vec2()).as_dvec3()
        });
        let to_light = position - point;
        let distance_squared = to_light.length_squared();
        let cosine = -to_light.dot(triangle.normal) / distance_squared.sqrt();
        (cosine > 0.0 || triangle.both_sides && cosine < 0.0).then(|| LightSample {
            source: Source::Point { position, error: triangle.error, normal: triangle.normal },
            radiance: triangle.radiance * share,
            pdf: self.share() * triangle.weight / total(&self.emitted) * distance_squared / cosine.abs(),
            is_delta: false,
        })
    }

    fn sample_sky(&self, scene: &Scene, random: &mut Random) -> Option<LightSample> {
        let sky = scene.environment.as_ref()?;
        let texel = pick(&self.from_sky, random.uniform());
        let u = DVec2::new(random.uniform(), random.uniform());
        let radiance = sky.texels[texel].as_dvec3();
        let (column, row) = (texel as u32 % sky.width, texel as u32 / sky.width);
        Some(LightSample {
            source: Source::Direction(sky.direction([column, row], u)),
            radiance,
            pdf: self.environment_pdf(radiance),
            is_delta: false,
        })
    }

    /// The density, per unit solid angle, with which [`Lights::sample`] picks a point of an emitter of a material, seen at an angle of
    /// `cosine` to its normal.
    pub fn emitter_pdf(&self, material: u32, distance_squared: f64, cosine: f64) -> f64 {
        let emitted = total(&self.emitted);
        // Textures may be black all over.
        let per_area = if emitted > 0.0 { self.share() * self.weights[material as usize] / emitted } else { 0.0 };
        per_area * distance_squared / cosine.abs()
    }

    /// The density, per unit solid angle, with which [`Lights::sample`] picks a direction that `radiance` comes from.
    pub fn environment_pdf(&self, radiance: DVec3) -> f64 {
        let from_sky = total(&self.from_sky);
        if from_sky > 0.0 { self.share() * luminance(radiance) / from_sky } else { 0.0 }
    }
}

impl EmissiveTriangle {
    /// `None` without area: a ray never hits it.
    fn new(
        corners: [DVec3; 3],
        uvs: [DVec2; 3],
        placement: &Placement,
        material: &Material,
        weight: f64,
    ) -> Option<EmissiveTriangle> {
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
            texture: material.emission_texture.map(|texture| (texture, uvs)),
            both_sides: material.emits_both_sides,
            weight,
        })
    }

    fn area(&self) -> f64 {
        self.edge1.cross(self.edge2).length() / 2.0
    }
}
