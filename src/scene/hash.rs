//! A fingerprint of everything in a scene that a picture of it depends on.

use blake3::Hasher;
use bytemuck::{NoUninit, cast_slice};
use glam::{Affine3A, Vec3};

use super::{
    Camera, Color, Environment, Film, Fresnel, Instance, LayerBase, Layered, Lens, Material, Mesh, Patches, Scene, Sun,
    Surface, Texture, TexturePlacement, Woven, Yarn,
};

impl Scene {
    /// BLAKE3 over the scene's content, in hexadecimal. Names and file paths do not enter.
    pub fn hash(&self) -> String {
        let mut hasher = Hasher::new();
        let Scene { camera, film, meshes, instances, materials, textures, brdfs, environment, sun } = self;
        let Camera { eye, target, up, vertical_fov_degrees, lens } = camera;
        let Film { width, height } = film;
        put(&mut hasher, &[*eye, *target, *up]);
        put(&mut hasher, &[*vertical_fov_degrees]);
        put(&mut hasher, &lens.map_or(vec![], |Lens { radius, focus_distance }| vec![radius, focus_distance]));
        put(&mut hasher, &[*width, *height]);
        put(
            &mut hasher,
            &[meshes.len(), instances.len(), materials.len(), textures.len(), brdfs.len()].map(|count| count as u64),
        );
        for Mesh { name: _, positions, normals, uvs, triangles, materials } in meshes {
            put(&mut hasher, positions);
            put(&mut hasher, normals);
            put(&mut hasher, uvs);
            put(&mut hasher, triangles);
            put(&mut hasher, materials);
        }
        for Instance { mesh, object_to_world: Affine3A { matrix3, translation } } in instances {
            put(&mut hasher, &[*mesh]);
            put(&mut hasher, &matrix3.to_cols_array());
            put(&mut hasher, &translation.to_array());
        }
        for material in materials {
            let Material {
                name: _,
                surface,
                emission,
                emission_texture,
                emits_both_sides,
                opacity,
                normal_map,
                roughness_map,
                anisotropy_direction_map,
                patches,
            } = material;
            put_surface(&mut hasher, surface);
            put(&mut hasher, &[*emission]);
            put(&mut hasher, &[u8::from(*emits_both_sides)]);
            if !opacity.is_whole() {
                put(&mut hasher, b"opacity");
                put(&mut hasher, &[opacity.value]);
                put(&mut hasher, &opacity.texture.map_or(vec![], |texture| vec![texture]));
            }
            if let Some(texture) = emission_texture {
                put(&mut hasher, b"emission");
                put(&mut hasher, &[*texture]);
            }
            if let Some(texture) = normal_map {
                put(&mut hasher, b"normal map");
                put(&mut hasher, &[*texture]);
            }
            if let Some(texture) = roughness_map {
                put(&mut hasher, b"roughness map");
                put(&mut hasher, &[*texture]);
            }
            if let Some(texture) = anisotropy_direction_map {
                put(&mut hasher, b"anisotropy direction map");
                put(&mut hasher, &[*texture]);
            }
            if let Some(Patches { map, material }) = patches {
                put(&mut hasher, b"patches");
                put(&mut hasher, &[*map, *material]);
            }
        }
        for Texture { name: _, width, height, texels, placement } in textures {
            put(&mut hasher, &[*width, *height]);
            put(&mut hasher, texels);
            if *placement != TexturePlacement::default() {
                put(&mut hasher, b"placement");
                put(&mut hasher, &[placement.scale, placement.offset]);
            }
        }
        brdfs.iter().for_each(|brdf| brdf.put(&mut hasher));
        if let Some(Environment { width, height, texels, rotation_degrees }) = environment {
            put(&mut hasher, b"environment");
            put(&mut hasher, &[*width, *height]);
            put(&mut hasher, texels);
            put(&mut hasher, &[*rotation_degrees]);
        }
        if let Some(Sun { direction, irradiance }) = sun {
            put(&mut hasher, b"sun");
            put(&mut hasher, &[*direction, *irradiance]);
        }
        hasher.finalize().to_hex().to_string()
    }
}

fn put_surface(hasher: &mut Hasher, surface: &Surface) {
    match surface {
        Surface::Diffuse { albedo } => {
            put(hasher, b"diffuse");
            put_color(hasher, albedo);
        }
        Surface::Conductor { fresnel, alpha } => {
            put(hasher, b"conductor");
            put_fresnel(hasher, fresnel);
            put(hasher, &[*alpha]);
        }
        Surface::Dielectric { ior, alpha } => {
            put(hasher, b"dielectric");
            put(hasher, &[*ior, *alpha]);
        }
        Surface::Coated { albedo, ior, alpha } => {
            put(hasher, b"coated");
            put_color(hasher, albedo);
            put(hasher, &[*ior, *alpha]);
        }
        Surface::Measured { brdf } => {
            put(hasher, b"measured");
            put(hasher, &[*brdf]);
        }
        Surface::Layered(Layered { ior, alpha, absorption, base }) => {
            put(hasher, b"layered");
            put(hasher, &[*ior, *alpha]);
            put(hasher, &[*absorption]);
            match base {
                LayerBase::Diffuse { albedo } => put(hasher, &[*albedo]),
                LayerBase::Conductor { fresnel, alpha } => {
                    put_fresnel(hasher, fresnel);
                    put(hasher, &[*alpha]);
                }
            }
        }
        Surface::Woven(Woven { warp, weft }) => {
            put(hasher, b"woven");
            for Yarn { coverage, gloss, f0, albedo, specular_width, volume_width, isotropy } in [warp, weft] {
                put(hasher, &[*coverage, *gloss, *specular_width, *volume_width, *isotropy]);
                put(hasher, &[*f0, *albedo]);
            }
        }
    }
}

fn put_fresnel(hasher: &mut Hasher, fresnel: &Fresnel) {
    match fresnel {
        Fresnel::Schlick { f0 } => put_color(hasher, f0),
        Fresnel::Complex { eta, kappa } => put(hasher, &[*eta, *kappa]),
    }
}

fn put_color(hasher: &mut Hasher, Color { value, texture }: &Color) {
    put::<Vec3>(hasher, &[*value]);
    put(hasher, &texture.map_or(vec![], |texture| vec![texture]));
}

/// Adds a sequence, preceded by its length so that no two scenes make the same bytes.
pub(super) fn put<T: NoUninit>(hasher: &mut Hasher, items: &[T]) {
    hasher.update(&(items.len() as u64).to_le_bytes());
    hasher.update(cast_slice(items));
}
