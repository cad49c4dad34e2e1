//! The lights of a scene in device memory.

use std::sync::Arc;

use glam::{Vec2, Vec2Swizzles, Vec3};

use super::error::Error;
use super::geometry::overwrite;
use super::kernels::Features;
use super::layout::{AliasRecord, EmitterLeafRecord, EmitterRecord, LightNodeRecord, SceneTable};
use super::material_record::MaterialRecord;
use crate::gpu::{Buffer, Upload};
use crate::scene::{EmissiveTriangle, Instance, LightNode, LightTable, Scene, luminance};

/// The lights on the device, without what the features say is not there.
#[derive(Default)]
pub struct DeviceLights {
    /// [`LightTable::alias`].
    pub alias: Option<Arc<Buffer>>,
    /// The emissive triangles.
    pub emitters: Option<Arc<Buffer>>,
    /// What picks one of these.
    pub tree: DeviceLightTree,
    /// Texels of the sky.
    pub environment: Option<Arc<Buffer>>,
    /// What the scene's table has of them, and zeros for the rest.
    pub table: SceneTable,
    /// The instances that emit, with their indices, as they stood then.
    pub lamps: Vec<(u32, Instance)>,
}

/// [`LightTable::tree`] on the device.
#[derive(Default)]
pub struct DeviceLightTree {
    /// [`LightNodeRecord`]s.
    pub nodes: Option<Arc<Buffer>>,
    /// Of each pair of nodes, the node above.
    pub parents: Option<Arc<Buffer>>,
    /// [`EmitterLeafRecord`]s.
    pub leaves: Option<Arc<Buffer>>,
}

impl DeviceLights {
    /// What the scene has now, in the buffers that are there where it fits. The texels of a sky that is the same stay there.
    ///
    /// # Errors
    /// Out of memory.
    pub fn overwritten(
        &self,
        upload: &mut Upload,
        scene: &Scene,
        lights: &LightTable,
        features: &Features,
        sky_changed: bool,
    ) -> Result<DeviceLights, Error> {
        let mut next = DeviceLights::default();
        if features.samples_lights() {
            let mut records: Vec<_> =
                lights.alias.iter().map(|(keep, alias)| AliasRecord { keep: *keep, alias: *alias }).collect();
            if records.is_empty() {
                // Kernels that were built for lights pick one also where all are dark.
                records.push(AliasRecord { keep: 1.0, alias: 0 });
            }
            next.alias = Some(overwrite(upload, self.alias.as_ref(), "light table", &records)?);
        }
        if features.emitters {
            let records: Vec<_> = lights.triangles.iter().map(|triangle| emitter(scene, *triangle)).collect();
            next.emitters = Some(overwrite(upload, self.emitters.as_ref(), "emitters", &records)?);
        }
        if let Some(tree) = lights.tree.as_ref().filter(|_| features.light_tree) {
            let nodes: Vec<_> = tree.nodes.iter().map(LightNodeRecord::from).collect();
            let leaf = |(triangle, node): (&[u32; 2], &u32)| {
                let [instance, index] = *triangle;
                let density = lights.emitter_share / scene.emissive_triangle(*triangle).area().max(1e-30);
                EmitterLeafRecord { instance, triangle: index, node: *node, density: density as f32 }
            };
            let leaves: Vec<_> = lights.triangles.iter().zip(&tree.leaves).map(leaf).collect();
            next.tree = DeviceLightTree {
                nodes: Some(overwrite(upload, self.tree.nodes.as_ref(), "light tree", &nodes)?),
                parents: Some(overwrite(upload, self.tree.parents.as_ref(), "light tree's parents", &tree.parents)?),
                leaves: Some(overwrite(upload, self.tree.leaves.as_ref(), "light tree's leaves", &leaves)?),
            };
        }
        next.environment = match &scene.environment {
            Some(sky) if features.environment && sky_changed => {
                Some(overwrite(upload, self.environment.as_ref(), "environment", &sky.texels)?)
            }
            _ => self.environment.clone(),
        };
        next.table = next.table_of(scene, lights);
        Ok(next)
    }

    fn table_of(&self, scene: &Scene, lights: &LightTable) -> SceneTable {
        let address = |buffer: &Option<Arc<Buffer>>| buffer.as_ref().map_or(0, |buffer| buffer.address());
        let sky = scene.environment.as_ref();
        let turn = sky.map_or(0.0, |sky| sky.rotation_degrees).to_radians();
        let sun = scene.sun;
        SceneTable {
            light_alias: address(&self.alias),
            emitters: address(&self.emitters),
            light_nodes: address(&self.tree.nodes),
            light_parents: address(&self.tree.parents),
            emitter_leaves: address(&self.tree.leaves),
            environment: address(&self.environment),
            emitter_count: lights.triangles.len() as u32,
            environment_size: sky.map_or([0, 0], |sky| [sky.width, sky.height]),
            environment_rotation: [turn.cos(), turn.sin()],
            emitter_density: lights.emitter_density as f32,
            environment_density: lights.environment_density as f32,
            environment_floor: lights.environment_floor,
            sun_probability: lights.sun_probability as f32,
            sun_direction: sun.map_or(Vec3::ZERO, |sun| sun.direction).to_array(),
            sun_irradiance: sun.map_or(Vec3::ZERO, |sun| sun.irradiance).to_array(),
            ..SceneTable::default()
        }
    }
}

/// An emissive triangle in world space.
fn emitter(scene: &Scene, triangle: [u32; 2]) -> EmitterRecord {
    let EmissiveTriangle { corners: [a, b, c], uvs: [uv_a, uv_b, uv_c], material, mean_emission } =
        scene.emissive_triangle(triangle);
    EmitterRecord {
        corner: a.to_array(),
        edge_u: (b - a).to_array(),
        edge_v: (c - a).to_array(),
        emission: material.emission.to_array(),
        emits_both_sides: u32::from(material.emits_both_sides),
        emission_texture: material.emission_texture.unwrap_or(MaterialRecord::NO_TEXTURE),
        brightness: luminance(mean_emission),
        uv: uv_a.to_array(),
        uv_u: (uv_b - uv_a).to_array(),
        uv_v: (uv_c - uv_a).to_array(),
    }
}

impl From<&LightNode> for LightNodeRecord {
    fn from(node: &LightNode) -> LightNodeRecord {
        LightNodeRecord {
            center: node.center.to_array(),
            radius: node.radius,
            axis: octahedral(node.axis),
            spread_deviation: snorm_2x16([node.cos_spread, node.deviation / node.radius.max(1e-30)], f32::floor),
            power: node.power,
            child: node.child,
        }
    }
}

/// A unit vector in an octahedron's square (Cigolle et al. 2014).
fn octahedral(v: Vec3) -> u32 {
    let projected = v.truncate() / (v.x.abs() + v.y.abs() + v.z.abs());
    let folded = (Vec2::ONE - projected.yx().abs()) * Vec2::ONE.copysign(projected);
    snorm_2x16((if v.z < 0.0 { folded } else { projected }).to_array(), f32::round)
}

/// What `unpackSnorm2x16` of GLSL takes apart.
fn snorm_2x16(numbers: [f32; 2], round: fn(f32) -> f32) -> u32 {
    let [low, high] = numbers.map(|number| u32::from(round(number.clamp(-1.0, 1.0) * 32767.0) as i16 as u16));
    low | high << 16
}
