//! The path integral: emission, one light sample a vertex, BSDF sampling, combined by the balance heuristic.

use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;

use super::Reference;
use super::embree::{Hit, Ray};
use super::film::{RayCount, Sample};
use super::lights::{LightSample, Source};
use super::random::Random;
use super::surface::{SurfacePoint, leave};
use super::values::{Path, Values};
use crate::image::{Crop, Picture, Samples, plane};
use crate::material::Bsdf;

/// Paths longer than this many segments play Russian roulette.
const ROULETTE_AFTER: u32 = 3;

impl Reference<'_> {
    /// One sample of a pixel.
    pub(super) fn path<'s: 'p, 'p>(
        &'s self,
        pixel: [u32; 2],
        max_depth: u32,
        random: Random,
        values: &'p Values<'s>,
    ) -> Path<'p> {
        Box::pin(self.sample(pixel, max_depth, random, values))
    }

    async fn sample<'s>(&'s self, pixel: [u32; 2], max_depth: u32, mut random: Random, values: &Values<'s>) -> Sample {
        let jitter = DVec2::new(random.uniform(), random.uniform());
        let position = DVec2::new(pixel[0].into(), pixel[1].into()) + jitter;
        let lens = self.view.has_lens().then(|| DVec2::new(random.uniform(), random.uniform()));
        let (eye, mut direction) = self.view.ray(position, lens);
        let mut origin = eye.as_vec3();
        let mut cone = self.view.cone(direction);

        let mut sample = Sample::default();
        let mut throughput = DVec3::ONE;
        // Density of `direction` as the last BSDF picked it; `None` where no light sample competes with it.
        let mut picked_with: Option<f64> = None;

        for segment in 1..=max_depth {
            sample.rays.closest += 1;
            let Some((point, distance_squared)) = self.closest(origin, direction, &mut random) else {
                let radiance = self.sky(direction);
                let weight = picked_with.map_or(1.0, |pdf| balance(pdf, self.lights.environment_pdf(radiance)));
                sample.radiance += throughput * radiance * weight;
                break;
            };
            let (material, frame) = (point.material, &point.frame);
            let wo_world = -direction;

            if material.is_emissive() && (point.is_front || material.emits_both_sides) {
                let cosine = wo_world.dot(frame.geometric);
                let weight = picked_with.map_or(1.0, |pdf| {
                    balance(pdf, self.lights.emitter_pdf(point.material_index, distance_squared, cosine))
                });
                sample.radiance += throughput * point.emission * weight;
            }
            if segment == 1 {
                sample.albedo = point.color;
                // Glass keeps its side, feature channels face the viewer.
                sample.normal = if wo_world.dot(frame.geometric) < 0.0 { -frame.normal } else { frame.normal };
            }
            if segment == max_depth {
                break;
            }

            cone = cone.at(distance_squared.sqrt());
            let footprint = cone.footprint(point.uv, point.uv_density, wo_world.dot(frame.geometric));
            let surface = &self.surfaces[point.material_index as usize];
            let bsdf = match point.roughness {
                Some(roughness) => Bsdf::of_roughness(surface, point.color, roughness),
                None => Bsdf::at(surface, point.color, footprint),
            };
            let wo = frame.to_local(wo_world);
            if !bsdf.is_delta()
                && let Some(light) = self.lights.sample(&self.scene, point.position, &mut random)
            {
                let direct = self.direct(&point, &bsdf, wo, &light, values, (&mut random, &mut sample.rays)).await;
                sample.radiance += throughput * direct;
            }

            let u = [random.uniform(), random.uniform(), random.uniform()];
            let Some(scattered) = values.sample(&bsdf, wo, u).await else { break };
            direction = frame.to_world(scattered.wi).normalize();
            if !frame.is_consistent(direction, scattered.wi) {
                break;
            }
            throughput *= scattered.weight;
            picked_with = (!scattered.is_delta).then_some(scattered.pdf);
            cone = cone.scattered(picked_with);
            origin = point.leave(direction);

            if segment > ROULETTE_AFTER {
                // Radiance is ior² times as large inside glass, and throughput as much smaller.
                let importance = match &bsdf {
                    Bsdf::Dielectric(glass) if scattered.wi.z < 0.0 => glass.ior.powi(2),
                    _ => 1.0,
                };
                let survival = (importance * throughput.max_element()).min(1.0);
                if random.uniform() >= survival {
                    break;
                }
                throughput /= survival;
            }
        }
        sample
    }

    /// What a light sample adds at a point, weighted against finding the same light by the BSDF.
    async fn direct<'s>(
        &self,
        point: &SurfacePoint<'_>,
        bsdf: &Bsdf<'s>,
        wo: DVec3,
        light: &LightSample,
        values: &Values<'s>,
        (random, rays): (&mut Random, &mut RayCount),
    ) -> DVec3 {
        let wi_world = match light.source {
            Source::Point { position, .. } => (position - point.position).normalize_or_zero(),
            Source::Direction(direction) => direction,
        };
        let wi = point.frame.to_local(wi_world);
        if !point.frame.is_consistent(wi_world, wi) {
            return DVec3::ZERO;
        }
        let value = values.eval(bsdf, wo, wi).await * wi.z.abs();
        if value == DVec3::ZERO {
            return DVec3::ZERO;
        }

        let origin = point.leave(wi_world);
        let shadow_ray = match light.source {
            Source::Point { position, error, normal } => {
                let end = leave(position, error, normal, -wi_world);
                Ray { origin, direction: end - origin, t_min: 0.0, t_max: 1.0 }
            }
            Source::Direction(direction) => {
                Ray { origin, direction: direction.as_vec3(), t_min: 0.0, t_max: f32::INFINITY }
            }
        };
        rays.shadow += 1;
        if self.occluded(&shadow_ray, random) {
            return DVec3::ZERO;
        }
        let weight = if light.is_delta { 1.0 } else { balance(light.pdf, bsdf.pdf(wo, wi)) };
        value * light.radiance * (weight / light.pdf)
    }

    /// What a ray meets first, and the squared distance to it.
    fn closest(&self, origin: Vec3, direction: DVec3, random: &mut Random) -> Option<(SurfacePoint<'_>, f64)> {
        let hit = self.hit(origin, direction, random)?;
        let placement = &self.placements[hit.instance as usize];
        let origin = origin.as_dvec3();
        let point = SurfacePoint::new(&self.scene, placement, &hit, origin, direction)?;
        let distance_squared = (point.position - origin).length_squared();
        Some((point, distance_squared))
    }

    fn hit(&self, origin: Vec3, direction: DVec3, random: &mut Random) -> Option<Hit> {
        let ray = Ray { origin, direction: direction.as_vec3(), t_min: 0.0, t_max: f32::INFINITY };
        self.nearest(&ray, random)
    }

    /// Radiance from infinity.
    fn sky(&self, direction: DVec3) -> DVec3 {
        match &self.scene.environment {
            None => DVec3::ZERO,
            Some(sky) if sky.texels.len() == 1 => sky.texels[0].as_dvec3(),
            Some(sky) => sky.radiance(direction).as_dvec3(),
        }
    }

    /// Adds the planes of the ray through the pixel's centre: depth and ids.
    pub(super) fn add_centre_planes(&self, crop: Crop, picture: &mut Picture) {
        let seen_at = |pixel: usize| {
            let [column, row] = [pixel % crop.width as usize, pixel / crop.width as usize];
            let [x, y] = [crop.x + column as u32, crop.y + row as u32];
            let (eye, direction) = self.view.ray(DVec2::new(x.into(), y.into()) + 0.5, None);
            let mut random = Random::new(0, x.into(), y.into());
            let Some(hit) = self.hit(eye.as_vec3(), direction, &mut random) else {
                return (f32::INFINITY, [plane::NO_ID; 3]);
            };
            let placement = &self.placements[hit.instance as usize];
            let point = SurfacePoint::new(&self.scene, placement, &hit, eye, direction);
            let material = point.map_or(plane::NO_ID, |point| point.material_index);
            let depth = (f64::from(hit.t) * direction.dot(self.view.forward)) as f32;
            (depth, [hit.instance, hit.triangle, material])
        };
        let seen: Vec<(f32, [u32; 3])> = (0..picture.pixels()).into_par_iter().map(seen_at).collect();
        picture.set(plane::DEPTH, Samples::F32(seen.iter().map(|(depth, _)| *depth).collect()));
        for (id, name) in [plane::INSTANCE_ID, plane::PRIMITIVE_ID, plane::MATERIAL_ID].into_iter().enumerate() {
            picture.set(name, Samples::U32(seen.iter().map(|(_, ids)| ids[id]).collect()));
        }
    }
}

/// The balance heuristic (Veach 1997): the weight of a technique with density `used` against one with `other`.
fn balance(used: f64, other: f64) -> f64 {
    used / (used + other)
}
