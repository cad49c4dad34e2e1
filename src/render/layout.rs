//! The structs that host and kernels share; `glsl/layout` has each once more, and says what the members mean.
#![allow(missing_docs)]

use glam::{DVec3, Vec3};

use crate::scene::Scene;

crate::shared_structs! {
    /// The structs of the wavefront.
    pub const WAVEFRONT_STRUCTS;

    /// `glsl/layout/path.glsl`
    pub struct QueueCounter {
        pub groups: [u32; 3],
        pub count: u32,
    }

    /// `glsl/layout/path.glsl`
    pub struct PathPool {
        pub origin: u64,
        pub direction: u64,
        pub throughput: u64,
        pub radiance: u64,
        pub hit_key: u64,
        pub shadow_origin: u64,
        pub shadow_direction: u64,
        pub shadow_path: u64,
        pub queue: u64,
        pub counters: u64,
    }

    /// `glsl/layout/scene.glsl`
    pub struct EmitterRecord {
        pub corner: [f32; 3],
        pub edge_u: [f32; 3],
        pub edge_v: [f32; 3],
        pub emission: [f32; 3],
        pub emits_both_sides: u32,
        pub emission_texture: u32,
        pub brightness: f32,
        pub uv: [f32; 2],
        pub uv_u: [f32; 2],
        pub uv_v: [f32; 2],
    }

    /// `glsl/layout/scene.glsl`
    pub struct LightNodeRecord {
        pub center: [f32; 3],
        pub radius: f32,
        pub axis: u32,
        pub spread_deviation: u32,
        pub power: f32,
        pub child: u32,
    }

    /// `glsl/layout/scene.glsl`
    pub struct EmitterLeafRecord {
        pub instance: u32,
        pub triangle: u32,
        pub node: u32,
        pub density: f32,
    }

    /// `glsl/layout/scene.glsl`
    pub struct AliasRecord {
        pub keep: f32,
        pub alias: u32,
    }

    /// `glsl/layout/scene.glsl`
    pub struct TextureRecord {
        pub texels: u64,
        pub width: u32,
        pub height: u32,
        pub scale: [f32; 2],
        pub offset: [f32; 2],
    }

    /// `glsl/layout/scene.glsl`
    #[derive(Default)]
    pub struct SceneTable {
        pub instances: u64,
        pub meshes: u64,
        pub nodes: u64,
        pub materials: u64,
        pub textures: u64,
        pub light_alias: u64,
        pub emitters: u64,
        pub environment: u64,
        pub light_nodes: u64,
        pub light_parents: u64,
        pub emitter_leaves: u64,
        pub emitter_count: u32,
        pub environment_size: [u32; 2],
        pub environment_rotation: [f32; 2],
        pub emitter_density: f32,
        pub environment_density: f32,
        pub environment_floor: f32,
        pub sun_probability: f32,
        pub sun_direction: [f32; 3],
        pub sun_irradiance: [f32; 3],
        pub reach: f32,
    }

    /// `glsl/layout/film.glsl`
    pub struct CameraRecord {
        pub eye: [f32; 3],
        pub axis: [f32; 3],
        pub corner: [f32; 3],
        pub right: [f32; 3],
        pub down: [f32; 3],
        pub lens_right: [f32; 3],
        pub lens_up: [f32; 3],
        pub focus_distance: f32,
    }

    /// `glsl/layout/film.glsl`
    pub struct FilmTable {
        pub camera: u64,
        pub pixels: u64,
        pub features: u64,
        pub rejected: u64,
        pub crop_origin: [u32; 2],
        pub crop_size: [u32; 2],
        pub first_albedo: u64,
        pub first_normal: u64,
        pub reuse: u64,
        pub seed: u32,
        pub padding: u32,
    }

    /// `glsl/layout/film.glsl`: push constants of the wavefront's passes.
    pub struct Pass {
        pub scene: u64,
        pub film: u64,
        pub pool: PathPool,
        pub capacity: u32,
        pub bounce: u32,
        pub max_depth: u32,
        pub first_pixel: u32,
        pub pixel_count: u32,
        pub first_sample: u32,
        pub samples_per_pixel: u32,
        pub variant: u32,
    }

    /// `glsl/layout/error.glsl`: push constants of the error estimate.
    pub struct ErrorPass {
        pub pixels: u64,
        pub partial_sums: u64,
        pub pixel_count: u32,
        pub sample_count: f32,
    }

    /// Sums over a pixel's samples, each with the rounding error that its additions have lost: the value is their sum.
    #[derive(Default, PartialEq)]
    pub struct FilmPixel {
        /// Σ radiance.
        pub sum: [f32; 3],
        /// What `sum` lacks.
        pub sum_error: [f32; 3],
        /// Σ radiance².
        pub square: [f32; 3],
        /// What `square` lacks.
        pub square_error: [f32; 3],
    }

    /// What a pixel sees first: means over its samples, and depth and ids of one ray through its centre.
    #[derive(Default, PartialEq)]
    pub struct FeaturePixel {
        /// Mean colour of the material, 0 where nothing was hit.
        pub albedo: [f32; 3],
        /// Mean shading normal, world space, facing the viewer, 0 where nothing was hit.
        pub normal: [f32; 3],
        /// Distance along the camera's axis; infinite where nothing was hit.
        pub depth: f32,
        /// [`crate::image::plane::NO_ID`] where nothing was hit, here and below.
        pub instance: u32,
        /// Triangle of its mesh.
        pub triangle: u32,
        /// Index into the scene's materials.
        pub material: u32,
    }
}

impl Pass {
    /// `VARIANT_PROBE`
    pub const PROBE: u32 = 1;
}

impl CameraRecord {
    /// The camera of a scene over its film.
    pub fn new(scene: &Scene) -> CameraRecord {
        let camera = &scene.camera;
        let [width, height] = [scene.film.width, scene.film.height].map(f64::from);
        let axis = (camera.target.as_dvec3() - camera.eye.as_dvec3()).normalize();
        let right = axis.cross(camera.up.as_dvec3()).normalize();
        let down = axis.cross(right);
        // A pixel's side at distance 1.
        let pixel = 2.0 * (f64::from(camera.vertical_fov_degrees).to_radians() / 2.0).tan() / height;
        let corner = axis - right * (pixel * width / 2.0) - down * (pixel * height / 2.0);
        let lens_radius = camera.lens.map_or(0.0, |lens| f64::from(lens.radius));
        let single = |v: DVec3| Vec3::to_array(&v.as_vec3());
        CameraRecord {
            eye: camera.eye.to_array(),
            axis: single(axis),
            corner: single(corner),
            right: single(right * pixel),
            down: single(down * pixel),
            lens_right: single(right * lens_radius),
            lens_up: single(-down * lens_radius),
            focus_distance: camera.lens.map_or(1.0, |lens| lens.focus_distance),
        }
    }
}
