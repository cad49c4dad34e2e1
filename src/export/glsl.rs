//! The module as GLSL: the source itself, with includes in their places and the shape in that of specialization constants.

use std::collections::BTreeSet;

use super::Place;
use crate::render::NeuBrdfShape;

/// What `glsl/export/neubrdf.comp` includes, and it, by name below `glsl/`.
const SOURCES: &[(&str, &str)] = &[
    ("export/neubrdf.comp", include_str!("../../glsl/export/neubrdf.comp")),
    ("layout/neubrdf.glsl", include_str!("../../glsl/layout/neubrdf.glsl")),
    ("lib/circle.glsl", include_str!("../../glsl/lib/circle.glsl")),
    ("lib/constants.glsl", include_str!("../../glsl/lib/constants.glsl")),
    ("lib/exponential.glsl", include_str!("../../glsl/lib/exponential.glsl")),
    ("lib/ggx.glsl", include_str!("../../glsl/lib/ggx.glsl")),
    ("lib/half_angle.glsl", include_str!("../../glsl/lib/half_angle.glsl")),
    ("lib/healpix.glsl", include_str!("../../glsl/lib/healpix.glsl")),
    ("lib/hemisphere.glsl", include_str!("../../glsl/lib/hemisphere.glsl")),
    ("lib/lobes.glsl", include_str!("../../glsl/lib/lobes.glsl")),
    ("lib/neubrdf.glsl", include_str!("../../glsl/lib/neubrdf.glsl")),
    ("lib/neubrdf_surface.glsl", include_str!("../../glsl/lib/neubrdf_surface.glsl")),
    ("lib/neubrdf_by_buffer.glsl", include_str!("../../glsl/lib/neubrdf_by_buffer.glsl")),
];

/// The text, to be included behind `#version 450`. With NEUBRDF_KERNEL defined it is a compute shader of its own.
pub fn module(shape: &NeuBrdfShape, place: Place) -> String {
    let mut flat = Flat { text: String::new(), seen: BTreeSet::new(), shape };
    let Place { group, binding } = place;
    flat.text = format!("#define NEUBRDF_SET {group}\n#define NEUBRDF_BINDING {binding}\n");
    flat.include("lib/neubrdf_by_buffer.glsl");
    flat.text.push_str("\n#ifdef NEUBRDF_KERNEL\n");
    flat.include("export/neubrdf.comp");
    flat.text.push_str("\n#endif\n");
    flat.text
}

struct Flat<'a> {
    text: String,
    seen: BTreeSet<&'static str>,
    shape: &'a NeuBrdfShape,
}

impl Flat<'_> {
    /// Appends a source, unless it is there already.
    fn include(&mut self, wanted: &str) {
        let Some((name, source)) = SOURCES.iter().find(|(name, _)| *name == wanted) else {
            unreachable!("SOURCES lacks {wanted}, which one of them includes");
        };
        if !self.seen.insert(*name) {
            return;
        }
        self.text.push_str(&format!("\n// ---- {name} ----\n"));
        for line in source.lines() {
            if let Some(included) = line.strip_prefix("#include \"").and_then(|rest| rest.strip_suffix('"')) {
                self.include(included);
            } else if !line.starts_with("#version") && !line.contains("GL_GOOGLE_include_directive") {
                self.text.push_str(&self.with_shape(line));
                self.text.push('\n');
            }
        }
    }

    /// `layout(constant_id = 20) const uint NAME = 4u;` becomes `const uint NAME = VALUE;`, whatever follows it.
    fn with_shape(&self, line: &str) -> String {
        let constant = || {
            let (id, rest) = line.strip_prefix("layout(constant_id = ")?.split_once(") ")?;
            let (_, value) = self.shape.specialization().into_iter().find(|(known, _)| id.parse() == Ok(*known))?;
            let (declaration, rest) = rest.split_once(" = ")?;
            let (_, comment) = rest.split_once(';')?;
            let value = match declaration.starts_with("const bool ") {
                true => (value != 0).to_string(),
                false => format!("{value}u"),
            };
            Some(format!("{declaration} = {value};{comment}"))
        };
        constant().unwrap_or_else(|| line.to_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::brdf::Precision;

    #[test]
    fn nothing_is_left_to_include_or_to_specialize() {
        let text = module(&NeuBrdfShape::of([], Precision::F16), Place::default());
        assert!(!text.contains("#include") && !text.contains("constant_id"));
        assert!(text.contains("const uint NEUBRDF_FEATURE_GROUPS = 1u;") && text.contains("NEUBRDF_HALF = true;"));
        for (name, _) in SOURCES {
            assert_eq!(text.matches(&format!("// ---- {name} ----")).count(), 1, "{name}");
        }
    }
}
