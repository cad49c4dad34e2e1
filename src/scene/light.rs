//! Lights and the table that picks one of them by power.
//!
//! The table's entries are, in this order, every emissive triangle of every instance, every texel of the environment,
//! and the sun. Each of these three kinds that shines gets the same share of the samples: what a lamp and the sky do to
//! the surfaces in view does not follow from their powers, as a scene may reach far beyond the view. Within a kind an entry is
//! picked with probability proportional to its power, so that the densities which multiple importance sampling needs have
//! closed forms, with `Y` the luminance:
//!
//! - a point on an emissive triangle, per unit area:
//!   [`emitter_density`](LightTable::emitter_density)` · Y(emission) · sides`, the emission that of [`Scene::mean_emission`];
//!   of more than two, one is picked by what it sends to the point where the sample is taken ([`LightTree`]), with a probability of
//!   [`emitter_share`](LightTable::emitter_share)` · `[`LightTree::probability`];
//! - a direction to the environment, per unit solid angle:
//!   [`environment_density`](LightTable::environment_density)` · max(0, Y(radiance) − `[`environment_floor`](LightTable::environment_floor)`)`;
//! - the sun: the probability [`sun_probability`](LightTable::sun_probability).
//!
//! The floor is the sky's mean luminance. A BSDF's samples see the sky as well, and what is no brighter than its mean they find often enough; light
//! samples that leave it to them are there for the rest (Karlík et al., *MIS Compensation*, ACM TOG 38(6), 2019). An even sky is left to them
//! altogether.

use glam::{DVec2, DVec3, Vec2, Vec3};
use std::f64::consts::{PI, TAU};

use super::light_tree::LightTree;
use super::{Instance, Material, Mesh, Scene, Texture};

/// Largest radiance and irradiance that a scene may hold, so that sums of them stay finite in `f32`.
pub(super) const BRIGHTEST: f32 = 1e12;

/// Light of a kind that amounts to less is not sampled, so that densities are finite in `f32`; paths may still run into it.
const FAINTEST: f64 = 1e-36;

/// A sky that is nowhere brighter than this many times its mean is even: sampling it costs more than it gains (docs/design.md).
const EVEN: f32 = 3.0;

/// So many emissive triangles, the two of one lamp, are picked by power, more of them by a tree (docs/design.md).
const FEW: usize = 2;

/// A lat-long environment: radiance constant over each texel, so that sampling it by texel is exact.
///
/// For a unit direction d towards the sky, after turning it about +y by −`rotation_degrees`:
/// u = atan2(d.x, −d.z)/2π + ½ and v = acos(d.y)/π, texel (⌊u·width⌋, ⌊v·height⌋). A constant sky has one texel.
#[derive(Clone, Debug, PartialEq)]
pub struct Environment {
    /// Texels around, ≥ 1.
    pub width: u32,
    /// Texels from zenith to nadir, ≥ 1.
    pub height: u32,
    /// `width × height` radiances, row by row from the zenith, in [0, 10¹²].
    pub texels: Vec<Vec3>,
    /// Turns the sky about +y, counter-clockwise seen from above.
    pub rotation_degrees: f32,
}

/// A directional light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sun {
    /// Unit vector towards the sun.
    pub direction: Vec3,
    /// Irradiance on a surface that faces it, W·m⁻², ≥ 0.
    pub irradiance: Vec3,
}

/// An alias table over all lights of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct LightTable {
    /// (instance, triangle) of each emissive triangle, in ascending order.
    pub triangles: Vec<[u32; 2]>,
    /// What picks one of these triangles where they are more than a few.
    pub tree: Option<LightTree>,
    /// Number of environment texels; none if the sky is even.
    pub environment_texels: u32,
    /// Walker's alias method: entry i stays with probability `.0`, else gives way to entry `.1`. A table of the emissive triangles, or of one entry for all of
    /// them if there is a tree; behind it another one, of the environment's texels.
    pub alias: Vec<(f32, u32)>,
    /// Of the samples, that emissive triangles get. 0 without any.
    pub emitter_share: f64,
    /// Times luminance and sides: density per area of a point on an emissive triangle. 0 without any.
    pub emitter_density: f64,
    /// Times what the luminance has above the floor: density per solid angle of a direction to the environment. 0 if none is sampled.
    pub environment_density: f64,
    /// Luminance up to which the environment is not sampled: its mean over the sphere.
    pub environment_floor: f32,
    /// With which the sun is picked. 0 without one.
    pub sun_probability: f64,
}

/// A triangle that emits, in world space.
#[derive(Clone, Copy, Debug)]
pub struct EmissiveTriangle<'a> {
    /// In an order in which (b − a) × (c − a) points to the front.
    pub corners: [Vec3; 3],
    /// Of the corners; (0, 0) where the mesh has none.
    pub uvs: [Vec2; 3],
    /// Of the triangle.
    pub material: &'a Material,
    /// See [`Scene::mean_emission`].
    pub mean_emission: Vec3,
}

impl EmissiveTriangle<'_> {
    /// In world space.
    pub fn area(&self) -> f64 {
        self.normal_times_two_areas().length() / 2.0
    }

    /// Of the front: unit, or 0 where the area is.
    pub fn normal(&self) -> Vec3 {
        self.normal_times_two_areas().normalize_or_zero().as_vec3()
    }

    fn normal_times_two_areas(&self) -> DVec3 {
        let [a, b, c] = self.corners.map(Vec3::as_dvec3);
        (b - a).cross(c - a)
    }

    /// Over π.
    fn power(&self) -> f64 {
        let sides = if self.material.emits_both_sides { 2.0 } else { 1.0 };
        f64::from(luminance(self.mean_emission)) * self.area() * sides
    }
}

impl Scene {
    /// A triangle of an instance in the world.
    pub fn emissive_triangle(&self, [instance, triangle]: [u32; 2]) -> EmissiveTriangle<'_> {
        let Instance { mesh, object_to_world } = self.instances[instance as usize];
        let mesh = &self.meshes[mesh as usize];
        let mut corners = mesh.corners(triangle as usize).map(|corner| object_to_world.transform_point3(corner));
        let mut uvs = mesh.corner_uvs(triangle as usize);
        if object_to_world.matrix3.determinant() < 0.0 {
            corners.swap(1, 2);
            uvs.swap(1, 2);
        }
        let material = &self.materials[mesh.material(triangle as usize) as usize];
        EmissiveTriangle { corners, uvs, material, mean_emission: self.mean_emission(mesh, triangle as usize) }
    }

    /// What a triangle emits on average, by which it is sampled. Of a texture that is the mean of four places in it, so that a hit can tell as well
    /// (`texture_mean` of glsl/lib/texture.glsl). Where the texture is black there, but not all over, paths find the light without its being sampled.
    pub fn mean_emission(&self, mesh: &Mesh, triangle: usize) -> Vec3 {
        let material = &self.materials[mesh.material(triangle) as usize];
        let texture = material.emission_texture.map(|texture| &self.textures[texture as usize]);
        texture
            .map_or(material.emission, |texture| material.emission * texture_mean(texture, mesh.corner_uvs(triangle)))
    }
}

/// The mean of a texture in the middle of a triangle and half-way from there to its corners.
fn texture_mean(texture: &Texture, [a, b, c]: [Vec2; 3]) -> Vec3 {
    let middle = (a + b + c) / 3.0;
    [middle, (middle + a) / 2.0, (middle + b) / 2.0, (middle + c) / 2.0]
        .map(|uv| texture.sample(uv))
        .iter()
        .sum::<Vec3>()
        / 4.0
}

/// Rec. 709 luminance.
pub fn luminance(color: Vec3) -> f32 {
    color.dot(Vec3::new(0.2126, 0.7152, 0.0722))
}

impl Environment {
    /// The same radiance from everywhere.
    pub fn constant(radiance: Vec3) -> Environment {
        Environment { width: 1, height: 1, texels: vec![radiance], rotation_degrees: 0.0 }
    }

    /// The (column, row) that a unit direction towards the sky falls in.
    pub fn texel_of(&self, direction: DVec3) -> [u32; 2] {
        let local = turn_about_y(direction, -self.rotation_radians());
        let u = local.x.atan2(-local.z) / TAU + 0.5;
        let v = local.y.clamp(-1.0, 1.0).acos() / PI;
        let cell = |coordinate: f64, count: u32| ((coordinate * f64::from(count)) as u32).min(count - 1);
        [cell(u, self.width), cell(v, self.height)]
    }

    /// Radiance that arrives from a unit direction towards the sky.
    pub fn radiance(&self, direction: DVec3) -> Vec3 {
        let [column, row] = self.texel_of(direction);
        self.texels[row as usize * self.width as usize + column as usize]
    }

    /// A unit direction inside a (column, row), for u in [0, 1)²: uniform over the texel's solid angle, because
    /// u.x is linear in the azimuth and u.y in the cosine of the polar angle.
    pub fn direction(&self, [column, row]: [u32; 2], u: DVec2) -> DVec3 {
        let azimuth = ((f64::from(column) + u.x) / f64::from(self.width) - 0.5) * TAU;
        let [upper, lower] = self.row_cosines(row);
        let cosine = upper + (lower - upper) * u.y;
        let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
        let local = DVec3::new(sine * azimuth.sin(), cosine, -sine * azimuth.cos());
        turn_about_y(local, self.rotation_radians())
    }

    /// Solid angle of each texel of a row, sr.
    pub fn solid_angle(&self, row: u32) -> f64 {
        let [upper, lower] = self.row_cosines(row);
        TAU / f64::from(self.width) * (upper - lower)
    }

    /// No light at all.
    pub fn is_black(&self) -> bool {
        self.texels.iter().all(|&radiance| radiance == Vec3::ZERO)
    }

    /// Mean luminance over the sphere.
    pub fn mean_luminance(&self) -> f64 {
        let rows = self.texels.chunks_exact(self.width as usize).enumerate();
        let sum: f64 = rows
            .map(|(row, texels)| {
                self.solid_angle(row as u32)
                    * texels.iter().map(|&radiance| f64::from(luminance(radiance))).sum::<f64>()
            })
            .sum();
        sum / (2.0 * TAU)
    }

    /// Whether no texel is much brighter than the mean.
    fn is_even(&self, mean: f32) -> bool {
        self.texels.iter().all(|&radiance| luminance(radiance) <= EVEN * mean)
    }

    /// Cosines of the polar angles that bound a row.
    fn row_cosines(&self, row: u32) -> [f64; 2] {
        [row, row + 1].map(|edge| (PI * f64::from(edge) / f64::from(self.height)).cos())
    }

    fn rotation_radians(&self) -> f64 {
        f64::from(self.rotation_degrees).to_radians()
    }
}

fn turn_about_y(v: DVec3, radians: f64) -> DVec3 {
    let (sine, cosine) = radians.sin_cos();
    DVec3::new(cosine * v.x + sine * v.z, v.y, cosine * v.z - sine * v.x)
}

impl LightTable {
    /// The table of a scene, in time linear in its triangles and texels; with a tree if more than two triangles emit.
    pub fn new(scene: &Scene) -> LightTable {
        LightTable::of(scene, None)
    }

    /// The same with a tree, or without.
    pub fn with_tree(scene: &Scene, has_tree: bool) -> LightTable {
        LightTable::of(scene, Some(has_tree))
    }

    fn of(scene: &Scene, has_tree: Option<bool>) -> LightTable {
        let mut triangles = Vec::new();
        let mut lamps = Vec::new();
        let mut weights = Vec::new();
        for (instance, Instance { mesh, .. }) in scene.instances.iter().enumerate() {
            let mesh = &scene.meshes[*mesh as usize];
            let emits = |material: u32| scene.materials[material as usize].is_emissive();
            if !mesh.materials.iter().any(|material| emits(*material)) {
                continue;
            }
            for triangle in (0..mesh.triangles.len()).filter(|triangle| emits(mesh.material(*triangle))) {
                let place = [instance as u32, triangle as u32];
                let lamp = scene.emissive_triangle(place);
                if lamp.mean_emission != Vec3::ZERO {
                    triangles.push(place);
                    weights.push(lamp.power());
                    lamps.push(lamp);
                }
            }
        }
        let emitted: f64 = weights.iter().sum();
        let tree = has_tree.unwrap_or(lamps.len() > FEW).then(|| LightTree::new(&lamps, &weights));
        if tree.is_some() {
            weights.truncate(1);
            weights.fill(emitted);
        }

        let mut environment_texels = 0;
        let mut texel_weights = Vec::new();
        let floor = scene.environment.as_ref().map_or(0.0, |environment| environment.mean_luminance() as f32);
        if let Some(environment) = &scene.environment
            && !environment.is_even(floor)
        {
            environment_texels = environment.width * environment.height;
            for (row, texels) in environment.texels.chunks_exact(environment.width as usize).enumerate() {
                let solid_angle = environment.solid_angle(row as u32);
                let above_floor = |&radiance: &Vec3| f64::from((luminance(radiance) - floor).max(0.0));
                texel_weights.extend(texels.iter().map(|radiance| solid_angle * above_floor(radiance)));
            }
        }
        let sun = scene.sun.map_or(0.0, |sun| f64::from(luminance(sun.irradiance)));
        let kinds = [emitted, texel_weights.iter().sum(), sun];
        let share = 1.0 / kinds.iter().filter(|weight| **weight > FAINTEST).count() as f64;
        let density = kinds.map(|weight| if weight > FAINTEST { share / weight } else { 0.0 });
        LightTable {
            triangles,
            tree,
            environment_texels,
            alias: [alias_table(&weights), alias_table(&texel_weights)].concat(),
            emitter_share: density[0] * emitted,
            emitter_density: density[0],
            environment_density: density[1],
            environment_floor: floor,
            sun_probability: density[2] * kinds[2],
        }
    }

    /// Whether the scene has no light.
    pub fn is_empty(&self) -> bool {
        [self.emitter_density, self.environment_density, self.sun_probability] == [0.0; 3]
    }
}

/// Walker's alias table (Vose 1991), computed in f64. An entry of weight 0 is never picked, whatever rounding leaves over, unless all are such.
fn alias_table(weights: &[f64]) -> Vec<(f32, u32)> {
    let total: f64 = weights.iter().sum();
    let Some(heaviest) = (0..weights.len()).max_by(|&a, &b| weights[a].total_cmp(&weights[b])) else {
        return Vec::new();
    };
    if total <= 0.0 {
        return vec![(1.0, 0); weights.len()];
    }

    let mut scaled: Vec<f64> = weights.iter().map(|weight| weight / total * weights.len() as f64).collect();
    let keep_or_leave = |weight: &f64| (if *weight > 0.0 { 1.0 } else { 0.0 }, heaviest as u32);
    let mut table: Vec<(f32, u32)> = weights.iter().map(keep_or_leave).collect();
    let (mut small, mut large): (Vec<usize>, Vec<usize>) = (0..scaled.len()).partition(|&entry| scaled[entry] < 1.0);
    while let (Some(&poor), Some(&rich)) = (small.last(), large.last()) {
        small.pop();
        table[poor] = (scaled[poor] as f32, rich as u32);
        scaled[rich] -= 1.0 - scaled[poor];
        if scaled[rich] < 1.0 {
            large.pop();
            small.push(rich);
        }
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Camera, Color, Film, Instance, Material, Mesh, Surface};
    use glam::{Affine3A, Quat};

    /// The probability of each entry that an alias table amounts to.
    fn implied(table: &[(f32, u32)]) -> Vec<f64> {
        let share = 1.0 / table.len() as f64;
        let mut probabilities = vec![0.0; table.len()];
        for (entry, &(stay, other)) in table.iter().enumerate() {
            probabilities[entry] += share * f64::from(stay);
            probabilities[other as usize] += share * (1.0 - f64::from(stay));
        }
        probabilities
    }

    fn assert_close(found: f64, expected: f64) {
        assert!((found - expected).abs() <= 1e-6 * expected.abs(), "found {found}, expected {expected}");
    }

    #[test]
    fn alias_probabilities_are_the_normalised_weights() {
        let spread: Vec<f64> = (0..10_000).map(|i| f64::from(i % 7) * 10f64.powi(i % 13 - 6)).collect();
        for weights in [vec![1.0], vec![0.0, 3.0, 0.0, 1.0], vec![0.1; 1000], spread] {
            let total: f64 = weights.iter().sum();
            for (probability, weight) in implied(&alias_table(&weights)).into_iter().zip(&weights) {
                assert_close(probability, weight / total);
            }
        }
        assert!(alias_table(&[]).is_empty());
        assert_eq!(alias_table(&[0.0, 0.0]), [(1.0, 0); 2]);
    }

    fn material(emission: f32, emits_both_sides: bool) -> Material {
        let albedo = Color::constant(Vec3::splat(0.5));
        let emission = Vec3::splat(emission);
        Material { emission, emits_both_sides, ..Material::new("m", Surface::Diffuse { albedo }) }
    }

    /// Of the sky's texels, of which the last is four times as bright as their mean.
    fn brightness(texel: u32) -> f32 {
        texel.pow(3) as f32
    }

    fn scene_with_all_lights() -> Scene {
        let mesh = Mesh {
            name: "strip".into(),
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::new(1.0, 1.0, 0.0), Vec3::new(3.0, 0.0, 0.0)],
            triangles: vec![[0, 1, 2], [1, 3, 2], [1, 4, 3]],
            materials: vec![0, 1, 2],
            ..Mesh::default()
        };
        let instance = |object_to_world| Instance { mesh: 0, object_to_world };
        Scene {
            camera: Camera { eye: Vec3::Z, target: Vec3::ZERO, up: Vec3::Y, vertical_fov_degrees: 40.0, lens: None },
            film: Film { width: 1, height: 1 },
            meshes: vec![mesh],
            instances: vec![
                instance(Affine3A::IDENTITY),
                instance(Affine3A::from_scale_rotation_translation(
                    Vec3::splat(2.0),
                    Quat::from_rotation_x(1.0),
                    Vec3::X,
                )),
            ],
            materials: vec![material(3.0, false), material(0.0, false), material(5.0, true)],
            textures: vec![],
            brdfs: vec![],
            environment: Some(Environment {
                width: 4,
                height: 3,
                texels: (0..12).map(|i| Vec3::splat(brightness(i))).collect(),
                rotation_degrees: 30.0,
            }),
            sun: Some(Sun { direction: Vec3::Y, irradiance: Vec3::splat(2.0) }),
        }
    }

    /// The closed forms of the module's head, on every entry.
    #[test]
    fn kinds_share_the_samples_and_entries_are_picked_by_their_power() {
        let scene = scene_with_all_lights();
        let table = LightTable::with_tree(&scene, false);
        assert_eq!(table.triangles, [[0, 0], [0, 2], [1, 0], [1, 2]]);
        assert_eq!(table.environment_texels, 12);
        assert_eq!(table.alias.len(), 4 + 12);
        assert_eq!(table.tree, None);

        let environment = scene.environment.as_ref().unwrap();
        let brightness_by_area = [3.0 * 0.5, 2.0 * 5.0 * 1.0, 3.0 * 2.0, 2.0 * 5.0 * 4.0];
        let emitted: f64 = brightness_by_area.iter().sum();
        let mean: f64 =
            (0..12).map(|i| f64::from(brightness(i)) * environment.solid_angle(i / 4)).sum::<f64>() / (4.0 * PI);
        assert_close(table.environment_floor.into(), mean);
        let above_mean = |texel: u32| (f64::from(brightness(texel)) - mean).max(0.0);
        let from_sky: f64 = (0..12).map(|i| above_mean(i) * environment.solid_angle(i / 4)).sum();
        for (probability, light) in implied(&table.alias[..4]).into_iter().zip(brightness_by_area) {
            assert_close(probability, light / emitted);
            assert_close(table.emitter_density * light, probability / 3.0);
        }
        for (texel, probability) in (0..).zip(implied(&table.alias[4..])) {
            let light = above_mean(texel) * environment.solid_angle(texel / 4);
            assert_close(probability, light / from_sky);
            assert_close(table.environment_density * light, probability / 3.0);
        }
        assert_close(table.sun_probability, 1.0 / 3.0);
    }

    /// Of triangles that a tree picks, the table has one entry for all; nothing else changes.
    #[test]
    fn a_tree_has_one_entry() {
        let scene = scene_with_all_lights();
        let [without, with] = [false, true].map(|has_tree| LightTable::with_tree(&scene, has_tree));
        assert_eq!(with.tree.as_ref().unwrap().leaves.len(), 4);
        assert_eq!(with.alias[..1], [(1.0, 0)]);
        assert_eq!(with.alias[1..], without.alias[4..]);
        assert_close(with.emitter_share, 1.0 / 3.0);
        let same = |table: &LightTable| {
            (table.triangles.clone(), table.emitter_density, table.environment_density, table.sun_probability)
        };
        assert_eq!(same(&with), same(&without));
    }

    /// The order of the corners follows the front, also in a mirror.
    #[test]
    fn emissive_triangles_face_their_front() {
        let mut scene = scene_with_all_lights();
        for sign in [1.0, -1.0] {
            scene.instances[0].object_to_world = Affine3A::from_scale(Vec3::new(sign, 1.0, 1.0));
            let emitter = scene.emissive_triangle([0, 0]);
            assert_eq!(emitter.normal(), Vec3::Z);
            assert_close(emitter.area(), 0.5);
        }
    }

    #[test]
    fn a_scene_without_light_has_an_empty_table() {
        let mut scene = scene_with_all_lights();
        scene.materials = vec![material(0.0, false); 3];
        scene.environment = Some(Environment::constant(Vec3::ZERO));
        scene.sun = None;
        let table = LightTable::new(&scene);
        assert!(table.is_empty());
        assert_eq!([table.emitter_density, table.environment_density, table.sun_probability], [0.0; 3]);
        assert!(table.tree.is_none() && table.emitter_share == 0.0);
    }

    /// A hemisphere that is twice as bright as the mean is none that light samples are for; a cap that has all the light is.
    #[test]
    fn an_even_sky_is_no_light() {
        let mut scene = scene_with_all_lights();
        let rows = |radiances: [f32; 6]| Environment {
            width: 1,
            height: 6,
            texels: radiances.map(Vec3::splat).to_vec(),
            rotation_degrees: 0.0,
        };
        for (radiances, texels) in
            [([1.0; 6], 0), ([2.0, 2.0, 2.0, 0.0, 0.0, 0.0], 0), ([9.0, 0.0, 0.0, 0.0, 0.0, 0.0], 6)]
        {
            scene.environment = Some(rows(radiances));
            let table = LightTable::new(&scene);
            assert_eq!(table.environment_texels, texels, "{radiances:?}");
            assert_eq!(table.alias.len() as u32, 1 + texels);
            assert_close(table.sun_probability, if texels == 0 { 1.0 / 2.0 } else { 1.0 / 3.0 });
        }
    }

    #[test]
    fn environment_texels_tile_the_sphere() {
        let environment = scene_with_all_lights().environment.unwrap();
        let total: f64 = (0..3).map(|row| 4.0 * environment.solid_angle(row)).sum();
        assert_close(total, 4.0 * PI);
        for row in 0..3 {
            for column in 0..4 {
                for u in [DVec2::splat(0.01), DVec2::new(0.3, 0.8), DVec2::splat(0.99)] {
                    let direction = environment.direction([column, row], u);
                    assert_close(direction.length(), 1.0);
                    assert_eq!(environment.texel_of(direction), [column, row]);
                    assert_eq!(environment.radiance(direction), Vec3::splat(brightness(row * 4 + column)));
                }
            }
        }
    }

    /// The definition in words: the middle of the picture looks along −z, right of it lies +x, the first row is up.
    #[test]
    fn environment_directions_are_as_documented() {
        let mut environment = Environment::constant(Vec3::ONE);
        (environment.width, environment.height) = (4, 2);
        assert_eq!(environment.texel_of(DVec3::new(0.1, 0.1, -1.0)), [2, 0]);
        assert_eq!(environment.texel_of(DVec3::new(-0.1, -0.1, -1.0)), [1, 1]);
        assert_eq!(environment.texel_of(DVec3::new(1.0, -0.1, 0.1)), [3, 1]);
        assert_eq!(environment.texel_of(DVec3::new(-1.0, 0.1, 0.1)), [0, 0]);
        // Turned a quarter counter-clockwise, what stood at −z now stands at −x.
        environment.rotation_degrees = 90.0;
        assert_eq!(environment.texel_of(DVec3::new(-1.0, 0.1, -0.1)), [2, 0]);
    }
}
