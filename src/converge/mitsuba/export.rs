//! Scenes as Mitsuba 3 reads them: `scene.xml` and a PLY file a mesh and material.
//!
//! What both renderers define alike is written; anything else is an error that names it, so that a difference of pictures is a difference of
//! renderers. Not alike are: rough surfaces (Mitsuba multiplies Smith's maskings of both directions, here they are correlated by height),
//! coats, layers, cloth, BRDFs from files, F0 other than 1, textures and skies of many texels (other interpolation), and lamps that shine to both sides.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use glam::{Mat3, Vec3};

use crate::image::write_file;
use crate::scene::{Fresnel, Material, Mesh, Scene, Surface};

/// Why a scene could not be exported.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The two renderers do not define it alike.
    #[error("Mitsuba does not define alike: {0}")]
    Different(String),
    /// A file could not be written.
    #[error(transparent)]
    Image(#[from] crate::image::Error),
    /// The system said no.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file or directory.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
}

/// Writes a scene into `directory`, to be traced to paths of `max_depth` segments; returns the XML file. Instances are written each by itself,
/// in world space.
pub fn export_mitsuba(scene: &Scene, max_depth: u32, directory: &Path) -> Result<PathBuf, ExportError> {
    let mut xml = String::from("<?xml version=\"1.0\"?>\n<scene version=\"3.0.0\">\n");
    let _ = writeln!(
        xml,
        "  <default name=\"spp\" value=\"16\"/>\n  <integrator type=\"path\"><integer name=\"max_depth\" value=\"{max_depth}\"/></integrator>"
    );
    xml.push_str(&sensor(scene));
    xml.push_str(&lights(scene)?);
    for (index, material) in scene.materials.iter().enumerate() {
        if is_used(scene, index as u32) {
            xml.push_str(&bsdf(material, index)?);
        }
    }
    // Not before it is clear that there is something to write.
    std::fs::create_dir_all(directory).map_err(|source| ExportError::Io { path: directory.to_owned(), source })?;
    for (index, instance) in scene.instances.iter().enumerate() {
        let mesh = &scene.meshes[instance.mesh as usize];
        for material in materials_of(mesh) {
            let name = format!("{index}-{material}.ply");
            let normal_to_world = Mat3::from(instance.object_to_world.matrix3).inverse().transpose();
            let place = |point: Vec3| instance.object_to_world.transform_point3(point);
            // A mirroring transform turns triangles around; their front stays where the normal of the object points.
            let is_mirrored = instance.object_to_world.matrix3.determinant() < 0.0;
            write_file(directory.join(&name), ply(mesh, material, place, normal_to_world, is_mirrored))?;
            let emission = scene.materials[material as usize].emission;
            let emitter = match emission == Vec3::ZERO {
                true => String::new(),
                false => format!("<emitter type=\"area\">{}</emitter>", rgb("radiance", emission)),
            };
            let _ = writeln!(
                xml,
                "  <shape type=\"ply\"><string name=\"filename\" value=\"{name}\"/><boolean name=\"face_normals\" value=\"{}\"/>\
                 <ref id=\"material-{material}\"/>{emitter}</shape>",
                mesh.normals.is_empty()
            );
        }
    }
    xml.push_str("</scene>\n");
    let path = directory.join("scene.xml");
    write_file(&path, xml)?;
    Ok(path)
}

fn different<T>(what: impl Into<String>) -> Result<T, ExportError> {
    Err(ExportError::Different(what.into()))
}

fn is_used(scene: &Scene, material: u32) -> bool {
    scene.instances.iter().any(|instance| scene.meshes[instance.mesh as usize].materials.contains(&material))
}

fn materials_of(mesh: &Mesh) -> Vec<u32> {
    let mut materials = mesh.materials.clone();
    materials.sort_unstable();
    materials.dedup();
    materials
}

fn rgb(name: &str, color: Vec3) -> String {
    format!("<rgb name=\"{name}\" value=\"{:?} {:?} {:?}\"/>", color.x, color.y, color.z)
}

fn point(name: &str, value: Vec3) -> String {
    format!("{name}=\"{:?}, {:?}, {:?}\"", value.x, value.y, value.z)
}

fn sensor(scene: &Scene) -> String {
    let camera = &scene.camera;
    let (kind, lens) = match camera.lens {
        None => ("perspective", String::new()),
        Some(lens) => (
            "thinlens",
            format!(
                "<float name=\"aperture_radius\" value=\"{:?}\"/><float name=\"focus_distance\" value=\"{:?}\"/>",
                lens.radius, lens.focus_distance
            ),
        ),
    };
    let bounds = scene.bounds();
    let reach = (bounds.center() - camera.eye).length() + bounds.radius();
    format!(
        "  <sensor type=\"{kind}\"><string name=\"fov_axis\" value=\"y\"/><float name=\"fov\" value=\"{:?}\"/>{lens}\
         <float name=\"near_clip\" value=\"{:?}\"/><float name=\"far_clip\" value=\"{:?}\"/>\
         <transform name=\"to_world\"><lookat {} {} {}/></transform>\
         <film type=\"hdrfilm\"><integer name=\"width\" value=\"{}\"/><integer name=\"height\" value=\"{}\"/>\
         <string name=\"pixel_format\" value=\"rgb\"/><string name=\"component_format\" value=\"float32\"/>\
         <rfilter type=\"box\"/></film>\
         <sampler type=\"independent\"><integer name=\"sample_count\" value=\"$spp\"/></sampler></sensor>\n",
        camera.vertical_fov_degrees,
        reach * 1e-6,
        reach * 2.0,
        point("origin", camera.eye),
        point("target", camera.target),
        point("up", camera.up),
        scene.film.width,
        scene.film.height
    )
}

fn lights(scene: &Scene) -> Result<String, ExportError> {
    let mut xml = String::new();
    if let Some(sky) = &scene.environment {
        let [radiance] = sky.texels.as_slice() else {
            return different("a sky of many texels, which is constant over each here and interpolated there");
        };
        if *radiance != Vec3::ZERO {
            let _ = writeln!(xml, "  <emitter type=\"constant\">{}</emitter>", rgb("radiance", *radiance));
        }
    }
    if let Some(sun) = &scene.sun {
        let towards = -sun.direction;
        let _ = writeln!(
            xml,
            "  <emitter type=\"directional\"><vector {} name=\"direction\"/>{}</emitter>",
            format_args!("x=\"{:?}\" y=\"{:?}\" z=\"{:?}\"", towards.x, towards.y, towards.z),
            rgb("irradiance", sun.irradiance)
        );
    }
    Ok(xml)
}

fn bsdf(material: &Material, index: usize) -> Result<String, ExportError> {
    let named = |what: &str| different(format!("material '{}': {what}", material.name));
    if material.emits_both_sides && material.is_emissive() {
        return named("it shines to both sides");
    }
    if material.textures().next().is_some() {
        return named("its texture");
    }
    let id = format!("id=\"material-{index}\"");
    if !material.opacity.is_whole() {
        return named("its opacity");
    }
    let both_sides = |inner: String| format!("  <bsdf type=\"twosided\" {id}>{inner}</bsdf>\n");
    Ok(match &material.surface {
        Surface::Diffuse { albedo } => {
            both_sides(format!("<bsdf type=\"diffuse\">{}</bsdf>", rgb("reflectance", albedo.value)))
        }
        Surface::Conductor { alpha, .. } if alpha.max_element() > 0.0 => return named("it is a rough metal"),
        Surface::Conductor { fresnel: Fresnel::Complex { eta, kappa }, .. } => {
            both_sides(format!("<bsdf type=\"conductor\">{}{}</bsdf>", rgb("eta", *eta), rgb("k", *kappa)))
        }
        Surface::Conductor { fresnel: Fresnel::Schlick { f0 }, .. } if f0.value == Vec3::ONE => {
            both_sides("<bsdf type=\"conductor\"><string name=\"material\" value=\"none\"/></bsdf>".into())
        }
        Surface::Conductor { .. } => return named("it is a metal of Schlick's reflectance"),
        Surface::Dielectric { alpha, .. } if *alpha > 0.0 => return named("it is rough glass"),
        Surface::Dielectric { ior, .. } => format!(
            "  <bsdf type=\"dielectric\" {id}><float name=\"int_ior\" value=\"{ior:?}\"/><float name=\"ext_ior\" value=\"1.0\"/></bsdf>\n"
        ),
        Surface::Coated { .. } => return named("it is coated"),
        Surface::Layered(_) => return named("it is layered"),
        Surface::Woven(_) => return named("it is woven"),
        Surface::Measured { .. } => return named("its BRDF is from a file"),
    })
}

/// The triangles of one material, binary, little-endian, corners not shared.
fn ply(mesh: &Mesh, material: u32, place: impl Fn(Vec3) -> Vec3, normal_to_world: Mat3, is_mirrored: bool) -> Vec<u8> {
    let triangles: Vec<usize> =
        (0..mesh.triangles.len()).filter(|triangle| mesh.material(*triangle) == material).collect();
    let has_normals = !mesh.normals.is_empty();
    let normals = if has_normals { "property float nx\nproperty float ny\nproperty float nz\n" } else { "" };
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n{normals}\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        triangles.len() * 3,
        triangles.len()
    )
    .into_bytes();
    let mut push = |vector: Vec3| vector.to_array().iter().for_each(|value| bytes.extend(value.to_le_bytes()));
    for triangle in &triangles {
        for corner in mesh.triangles[*triangle] {
            push(place(mesh.positions[corner as usize]));
            if has_normals {
                push((normal_to_world * mesh.normals[corner as usize]).normalize_or_zero());
            }
        }
    }
    for face in 0..triangles.len() as i32 {
        let [b, c] = if is_mirrored { [2, 1] } else { [1, 2] };
        bytes.push(3);
        [3 * face, 3 * face + b, 3 * face + c].iter().for_each(|index| bytes.extend(index.to_le_bytes()));
    }
    bytes
}
