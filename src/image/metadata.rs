//! What a picture file tells about its making.

use std::collections::HashMap;

use exr::meta::attribute::{AttributeValue, Text};
use serde::{Deserialize, Serialize};

/// How a picture was rendered. In an EXR file each field is a header attribute `neubrdf.FIELD`; what a file does not
/// say reads as the default (zero or empty).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Metadata {
    /// Hash of everything in the scene that can change the picture, hexadecimal.
    pub scene_hash: String,
    /// Samples a pixel (the least of all pixels).
    pub spp: u64,
    /// Seed of the random numbers.
    pub seed: u64,
    /// Longest path, in segments.
    pub max_depth: u32,
    /// What a path may bring of indirect light; 0: no limit.
    pub clamp_indirect: f32,
    /// Wall-clock time spent on sampling, seconds.
    pub render_seconds: f64,
    /// What it was rendered on.
    pub device: String,
    /// Version of the program.
    pub version: String,
    /// Where the random numbers came from.
    pub sampler: String,
    /// How rays met triangles.
    pub traversal: String,
    /// Centre of projection, world units.
    pub camera_eye: [f32; 3],
    /// A point on the optical axis.
    pub camera_target: [f32; 3],
    /// Up in the picture.
    pub camera_up: [f32; 3],
    /// Full vertical field of view, degrees.
    pub vertical_fov_degrees: f32,
    /// The whole film in pixels, of which the picture may be a part: EXR's display window. Zero means the picture's size.
    pub film_size: [u32; 2],
    /// Where the picture's upper left pixel lies on the film: the corner of EXR's data window.
    pub crop_origin: [u32; 2],
}

/// Attribute names begin with this.
const PREFIX: &str = "neubrdf.";

/// A custom attribute by its name without [`PREFIX`].
fn find<'a>(attributes: &'a HashMap<Text, AttributeValue>, name: &str) -> Option<&'a AttributeValue> {
    let name = format!("{PREFIX}{name}");
    attributes.iter().find(|(key, _)| key.bytes() == name.as_bytes()).map(|(_, value)| value)
}

impl Metadata {
    /// The custom attributes; the windows have their own place in the header.
    pub(super) fn attributes(&self, paths_shared_by: u32) -> HashMap<Text, AttributeValue> {
        // EXR text is bytes; what is beyond Latin-1 (a driver's name, at worst) becomes '?'.
        let text = |value: &str| {
            let latin: String = value.chars().map(|char| if u32::from(char) < 256 { char } else { '?' }).collect();
            AttributeValue::Text(Text::new_or_none(latin).unwrap_or_default())
        };
        let vector = |[x, y, z]: [f32; 3]| AttributeValue::FloatVec3((x, y, z));
        [
            ("sceneHash", text(&self.scene_hash)),
            // EXR has no 64-bit integer, and a double does not hold every seed.
            ("spp", text(&self.spp.to_string())),
            ("seed", text(&self.seed.to_string())),
            ("maxDepth", text(&self.max_depth.to_string())),
            ("clampIndirect", AttributeValue::F32(self.clamp_indirect)),
            ("pathsSharedBy", text(&paths_shared_by.to_string())),
            ("renderSeconds", AttributeValue::F64(self.render_seconds)),
            ("device", text(&self.device)),
            ("version", text(&self.version)),
            ("sampler", text(&self.sampler)),
            ("traversal", text(&self.traversal)),
            ("cameraEye", vector(self.camera_eye)),
            ("cameraTarget", vector(self.camera_target)),
            ("cameraUp", vector(self.camera_up)),
            ("verticalFovDegrees", AttributeValue::F32(self.vertical_fov_degrees)),
        ]
        .into_iter()
        .map(|(name, value)| (Text::from(format!("{PREFIX}{name}").as_str()), value))
        .collect()
    }

    /// [`crate::image::Picture::paths_shared_by`]
    pub(super) fn paths_shared_by(attributes: &HashMap<Text, AttributeValue>) -> u32 {
        match find(attributes, "pathsSharedBy") {
            Some(AttributeValue::Text(text)) => text.to_string().parse().unwrap_or(1).max(1),
            _ => 1,
        }
    }

    /// Reads the custom attributes; those of another type than ours are ignored.
    pub(super) fn from_attributes(attributes: &HashMap<Text, AttributeValue>) -> Metadata {
        let find = |name: &str| find(attributes, name);
        let text = |name: &str| match find(name) {
            Some(AttributeValue::Text(text)) => text.to_string(),
            _ => String::new(),
        };
        let number = |name: &str| match find(name) {
            Some(AttributeValue::F32(number)) => *number,
            _ => 0.0,
        };
        let vector = |name: &str| match find(name) {
            Some(AttributeValue::FloatVec3((x, y, z))) => [*x, *y, *z],
            _ => [0.0; 3],
        };
        Metadata {
            scene_hash: text("sceneHash"),
            spp: text("spp").parse().unwrap_or(0),
            seed: text("seed").parse().unwrap_or(0),
            max_depth: text("maxDepth").parse().unwrap_or(0),
            clamp_indirect: number("clampIndirect"),
            render_seconds: match find("renderSeconds") {
                Some(AttributeValue::F64(seconds)) => *seconds,
                _ => 0.0,
            },
            device: text("device"),
            version: text("version"),
            sampler: text("sampler"),
            traversal: text("traversal"),
            camera_eye: vector("cameraEye"),
            camera_target: vector("cameraTarget"),
            camera_up: vector("cameraUp"),
            vertical_fov_degrees: number("verticalFovDegrees"),
            film_size: [0; 2],
            crop_origin: [0; 2],
        }
    }
}
