//! Holes: which of the triangles that a ray comes to it meets.

use super::Reference;
use super::embree::{Hit, Ray};
use super::random::Random;
use crate::scene::Opacity;

impl Reference<'_> {
    /// The nearest triangle that the ray meets.
    pub(super) fn nearest(&self, ray: &Ray, random: &mut Random) -> Option<Hit> {
        match self.has_holes {
            true => self.accelerator.closest_of(ray, &self.chance(random)),
            false => self.accelerator.closest(ray),
        }
    }

    /// Whether the ray meets anything.
    pub(super) fn occluded(&self, ray: &Ray, random: &mut Random) -> bool {
        match self.has_holes {
            true => self.accelerator.occluded_by(ray, &self.chance(random)),
            false => self.accelerator.occluded(ray),
        }
    }

    /// What a ray meets, by its opacity: the answer for a triangle is the same however often Embree asks.
    fn chance(&self, random: &mut Random) -> impl Fn(&Hit) -> bool {
        let seed = random.uniform().to_bits();
        move |hit| Random::new(seed, hit.instance.into(), hit.triangle.into()).uniform() < self.opacity(hit)
    }

    /// The probability with which a ray meets the triangle there.
    fn opacity(&self, hit: &Hit) -> f64 {
        let mesh = &self.scene.meshes[self.scene.instances[hit.instance as usize].mesh as usize];
        let Opacity { value, texture } = self.scene.materials[mesh.material(hit.triangle as usize) as usize].opacity;
        let Some(texture) = texture else { return value.into() };
        let corners = mesh.triangles[hit.triangle as usize];
        let uv = match mesh.uvs.is_empty() {
            true => glam::Vec2::ZERO,
            false => {
                let [a, b, c] = corners.map(|corner| mesh.uvs[corner as usize]);
                (1.0 - hit.u - hit.v) * a + hit.u * b + hit.v * c
            }
        };
        f64::from(value) * f64::from(self.scene.textures[texture as usize].sample(uv).x)
    }
}
