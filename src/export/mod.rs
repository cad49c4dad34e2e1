//! The material alone: NeuBRDFs as a shader module and a buffer, for engines with a tracer of their own.
//!
//! `glsl/lib/neubrdf_by_buffer.glsl` says what the module offers. GLSL is written as it stands there; WGSL, HLSL and MSL come
//! from the same source, which build.rs has compiled to SPIR-V and naga translates.

mod glsl;
mod names;
mod specialize;
mod translate;

use std::fmt::{self, Write};
use std::str::FromStr;

use serde::Serialize;

use crate::render::{NeuBrdfShape, neubrdf_precision, pack_neubrdf_models};
use crate::scene::brdf::{Flaw, NeuBrdf, Precision};

pub use names::{NoPrefix, Prefix};

crate::shared_structs! {
    /// The structs of `glsl/export/neubrdf.comp`.
    pub const EXPORT_STRUCTS;

    /// What to evaluate: directions in the local frame, z along the normal.
    #[derive(Default)]
    pub struct ExportedQuery {
        /// Where light goes.
        pub wo: [f32; 3],
        /// First word of a model.
        pub model: u32,
        /// Where it comes from.
        pub wi: [f32; 3],
        /// Unused.
        pub padding_0: u32,
        /// Three numbers in [0, 1) for a sample.
        pub u: [f32; 3],
        /// Unused.
        pub padding_1: u32,
    }

    /// What comes of it.
    pub struct ExportedAnswer {
        /// f(wo, wi) in sr⁻¹, without the cosine.
        pub f: [f32; 3],
        /// The density of wi, in sr⁻¹.
        pub pdf: f32,
        /// The sample for wo and u.
        pub sampled_wi: [f32; 3],
        /// Its density; 0 where there is no sample.
        pub sampled_pdf: f32,
    }
}

/// The entry point that answers an array of [`ExportedQuery`], in workgroups of 64; under another prefix, [`Prefix::of`] it.
pub const ENTRY_POINT: &str = "neubrdf_answer";

/// A shading language.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Language {
    /// GLSL 4.50 for Vulkan.
    Glsl,
    /// WebGPU's.
    Wgsl,
    /// Direct3D's, shader model 6.0.
    Hlsl,
    /// Metal's, 2.4.
    Msl,
}

impl Language {
    /// The usual ending of its files.
    pub fn extension(self) -> &'static str {
        match self {
            Language::Glsl => "glsl",
            Language::Wgsl => "wgsl",
            Language::Hlsl => "hlsl",
            Language::Msl => "metal",
        }
    }
}

impl FromStr for Language {
    type Err = String;

    fn from_str(word: &str) -> Result<Language, String> {
        match word {
            "glsl" => Ok(Language::Glsl),
            "wgsl" => Ok(Language::Wgsl),
            "hlsl" => Ok(Language::Hlsl),
            "msl" => Ok(Language::Msl),
            _ => Err(format!("'{word}' is no shading language: expected glsl, wgsl, hlsl or msl")),
        }
    }
}

impl fmt::Display for Language {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Language::Glsl => "GLSL",
            Language::Wgsl => "WGSL",
            Language::Hlsl => "HLSL",
            Language::Msl => "MSL",
        })
    }
}

/// Where the models' buffer is bound; the entry point's queries and answers come after it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Place {
    /// Descriptor set, bind group or register space; nothing in MSL.
    pub group: u32,
    /// Binding, register or buffer index.
    pub binding: u32,
}

impl Place {
    /// The greatest group and binding: more than any device has.
    pub const MOST: u32 = 200;
    /// The greatest binding in MSL, whose buffers end at 30 (Metal Shading Language Specification): two more follow in the kernel.
    pub const MOST_OF_MSL: u32 = 28;
}

/// A model of an export.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ExportedModel {
    /// Its name.
    pub name: String,
    /// Where it begins in the buffer, in words of four bytes: the argument `model`.
    pub first_word: u32,
    /// Whether only the difference of azimuths matters: of one with frames it does not, as these have azimuths of their own.
    pub is_isotropic: bool,
    /// What it was trained on.
    pub source: String,
}

/// Why there is no module.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Nothing was given.
    #[error("no model to export")]
    Nothing,
    /// A model is not valid.
    #[error("{name}: {flaw}")]
    Invalid {
        /// Which.
        name: String,
        /// What is wrong.
        flaw: Flaw,
    },
    /// Nothing can be bound there.
    #[error("group {} and binding {}: expected at most {} for each, in MSL a binding of at most {}", .0.group, .0.binding, Place::MOST, Place::MOST_OF_MSL)]
    Place(Place),
    /// With it a name is that of a local variable.
    #[error("prefix '{0}': a name of the module is that of one of its local variables then, expected another prefix")]
    Prefix(Prefix),
    /// naga, or what precedes it, refuses the module: a fault of this program.
    #[error("the module cannot be written as {language}: {message}")]
    Translation {
        /// Which language.
        language: Language,
        /// Why.
        message: String,
    },
}

/// A module with its data.
#[derive(Clone, Debug, PartialEq)]
pub struct Exported {
    /// The module's text.
    pub shader: String,
    /// The buffer's words, little-endian in files; a multiple of 16 bytes.
    pub data: Vec<u32>,
    /// What is in it.
    pub models: Vec<ExportedModel>,
    /// How codes, weights and biases are stored.
    pub precision: Precision,
}

/// Writes named models as one module and one buffer. The module is made for the widest of them; numbers are stored as f16 where that
/// loses nothing. Modules of different prefixes stand in one shader together.
///
/// # Errors
/// No model, one that is not valid, a place that no language can say, or a prefix by which a name is that of a local variable.
pub fn export(
    models: &[(String, NeuBrdf)],
    language: Language,
    place: Place,
    prefix: &Prefix,
) -> Result<Exported, Error> {
    if models.is_empty() {
        return Err(Error::Nothing);
    }
    let most_binding = if language == Language::Msl { Place::MOST_OF_MSL } else { Place::MOST };
    if place.group > Place::MOST || place.binding > most_binding {
        return Err(Error::Place(place));
    }
    for (name, model) in models {
        model.validate().map_err(|flaw| Error::Invalid { name: name.clone(), flaw })?;
    }
    let of_models = || models.iter().map(|(_, model)| model);
    let precision = neubrdf_precision(of_models());
    let shape = NeuBrdfShape::of(of_models(), precision);
    let (data, firsts) = pack_neubrdf_models(of_models().map(|model| (model, &shape)));
    let models: Vec<ExportedModel> = models
        .iter()
        .zip(firsts)
        .map(|((name, model), first_word)| ExportedModel {
            name: name.clone(),
            first_word,
            is_isotropic: model.is_isotropic_about_z(),
            source: model.provenance.source.clone(),
        })
        .collect();
    let text = match language {
        Language::Glsl => glsl::module(&shape, place),
        _ => translate::module(&shape, language, place)?,
    };
    let module = header(language, place, prefix, &models) + &prefix.apply(&text)?;
    // WGSL has no preprocessor, and takes no name twice.
    let shader = if language == Language::Wgsl { module } else { prefix.guard(&module) };
    Ok(Exported { shader, data, models, precision })
}

impl Exported {
    /// The bytes of the data file.
    pub fn bytes(&self) -> Vec<u8> {
        self.data.iter().flat_map(|word| word.to_le_bytes()).collect()
    }
}

/// The comment that a module begins with.
fn header(language: Language, place: Place, prefix: &Prefix, models: &[ExportedModel]) -> String {
    // A name from a file must not end the line. WGSL has line breaks that are no control characters.
    let ends_lines = |c: char| c.is_control() || matches!(c, '\u{2028}' | '\u{2029}' | '\\');
    let printable = |text: &str| text.replace(ends_lines, " ");
    let mut text = format!(
        "// NeuBRDFs as {language}, by neubrdf {}: the material alone.\n//\n\
         // Functions; directions are unit vectors that point away from the surface, x along the tangent, z along the normal:\n\
         //     {prefix}_eval(model, wo, wi)      f in 1/sr, RGB, without the cosine; 0 if either is below the surface; of a material that varies over a texture, its average\n\
         //     {prefix}_pdf(model, wo, wi)       the density of {prefix}_sample, per unit solid angle\n\
         //     {prefix}_sample(model, wo, u)     wi and its pdf, 0 if there is none; u: three numbers in [0, 1)\n",
        env!("CARGO_PKG_VERSION"),
    );
    let _ = match language {
        Language::Glsl => writeln!(
            text,
            "// Bind the data read-only as storage buffer: set {}, binding {}.",
            place.group, place.binding
        ),
        Language::Wgsl => writeln!(
            text,
            "// Bind the data as read-only storage: @group({}) @binding({}).",
            place.group, place.binding
        ),
        Language::Hlsl => {
            writeln!(text, "// Bind the data as raw buffer: register(t{}, space{}).", place.binding, place.group)
        }
        Language::Msl => {
            writeln!(text, "// Give the data as constant device buffer: the last argument of each function.")
        }
    };
    text.push_str("// Models, by the first word in the data:\n");
    for model in models {
        let _ = writeln!(text, "//     {:>8}    {}", model.first_word, printable(&model.name));
    }
    text.push('\n');
    text
}
