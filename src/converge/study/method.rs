//! Methods: every choice that may change how fast a picture converges, and, but for models and the limit of indirect light, nothing that
//! changes what it converges to.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::render::{BsdfSampling, Sampler, Traversal};
use crate::scene::brdf::Precision;

/// What renders.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Engine {
    /// The wavefront on a Vulkan device, by a part of the device's or driver's name, its number, or `auto`.
    Vulkan(String),
    /// `crate::reference`.
    Embree,
    /// Mitsuba 3, by its own path tracer.
    Mitsuba,
}

/// One way to render a scene. What an engine has no choice about is `None`.
#[derive(Clone, Debug, PartialEq)]
pub struct Method {
    /// What renders.
    pub engine: Engine,
    /// How rays find triangles; `None`: what suits the device.
    pub traversal: Option<Traversal>,
    /// Where random numbers come from.
    pub sampler: Option<Sampler>,
    /// Whether lights are sampled.
    pub light_sampling: bool,
    /// How directions are picked.
    pub bsdf_sampling: BsdfSampling,
    /// Whether neighbouring pixels share paths.
    pub path_reuse: bool,
    /// How numbers of NeuBRDFs are held; `None`: in half precision where that loses nothing.
    pub precision: Option<Precision>,
    /// Paths in flight; `None`: what suits the device.
    pub pool: Option<u32>,
    /// Which of the scene's models of its materials is rendered; `None`: the scene as it is, which is the truth.
    pub model: Option<String>,
    /// What a path may bring of indirect light: its bias is the price of its noise. `None`: all that there is.
    pub clamp_indirect: Option<f32>,
}

/// The axes of a product of methods; what is empty has its default.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Axes {
    /// Devices, `embree`, `mitsuba`.
    pub device: Vec<String>,
    /// `ray-query`, `bvh`, `auto`.
    pub traversal: Vec<String>,
    /// `sobol`, `pcg`.
    pub sampler: Vec<String>,
    /// `on`, `off`.
    pub light_sampling: Vec<String>,
    /// `lobe`, `cosine`, `uniform`.
    pub bsdf_sampling: Vec<String>,
    /// `f32`, `f16`, `auto`.
    pub precision: Vec<String>,
    /// Numbers of paths, `auto`.
    pub pool: Vec<String>,
    /// Names of models, `truth`.
    pub model: Vec<String>,
    /// Radiances, `off`.
    pub clamp_indirect: Vec<String>,
    /// `on`, `off`.
    #[serde(default)]
    pub path_reuse: Vec<String>,
}

/// The names of the axes, as flags and study files have them.
pub const AXES: [&str; 10] = [
    "device",
    "traversal",
    "sampler",
    "light-sampling",
    "bsdf-sampling",
    "precision",
    "pool",
    "model",
    "clamp-indirect",
    "path-reuse",
];

impl Axes {
    /// The values of the axis of that name.
    pub fn axis_mut(&mut self, name: &str) -> Option<&mut Vec<String>> {
        Some(match name {
            "device" => &mut self.device,
            "traversal" => &mut self.traversal,
            "sampler" => &mut self.sampler,
            "light-sampling" => &mut self.light_sampling,
            "bsdf-sampling" => &mut self.bsdf_sampling,
            "precision" => &mut self.precision,
            "pool" => &mut self.pool,
            "model" => &mut self.model,
            "clamp-indirect" => &mut self.clamp_indirect,
            "path-reuse" => &mut self.path_reuse,
            _ => return None,
        })
    }

    /// All combinations, each once: Embree and Mitsuba have no choice about most axes.
    ///
    /// # Errors
    /// A word that an axis does not know.
    pub fn methods(&self) -> Result<Vec<Method>, UnknownWord> {
        let devices = choices("device", &self.device, "auto", |word| {
            Ok(match word {
                "embree" => Engine::Embree,
                "mitsuba" => Engine::Mitsuba,
                _ => Engine::Vulkan(word.to_owned()),
            })
        })?;
        let traversals = choices("traversal", &self.traversal, "auto", |word| match word {
            "auto" => Ok(None),
            _ => word.parse::<Traversal>().map(Some).map_err(|_| "ray-query, bvh or auto"),
        })?;
        let samplers = choices("sampler", &self.sampler, "sobol", |word| {
            word.parse::<Sampler>().map_err(|unknown| unknown.expected)
        })?;
        let light = choices("light-sampling", &self.light_sampling, "on", on_or_off)?;
        let bsdf = choices("bsdf-sampling", &self.bsdf_sampling, "lobe", |word| {
            word.parse::<BsdfSampling>().map_err(|unknown| unknown.expected)
        })?;
        let precisions = choices("precision", &self.precision, "auto", |word| match word {
            "auto" => Ok(None),
            "f32" => Ok(Some(Precision::F32)),
            "f16" => Ok(Some(Precision::F16)),
            _ => Err("f32, f16 or auto"),
        })?;
        let pools = choices("pool", &self.pool, "auto", |word| match word {
            "auto" => Ok(None),
            _ => match word.parse() {
                Ok(paths) if paths > 0 => Ok(Some(paths)),
                _ => Err("a number of paths of at least 1, or auto"),
            },
        })?;
        let models = choices("model", &self.model, "truth", |word| Ok((word != "truth").then(|| word.to_owned())))?;
        let limits = choices("clamp-indirect", &self.clamp_indirect, "off", |word| match word {
            "off" => Ok(None),
            _ => match word.parse::<f32>() {
                Ok(limit) if limit.is_finite() && limit > 0.0 => Ok(Some(limit)),
                _ => Err("a radiance above 0, or off"),
            },
        })?;
        let reuse = choices("path-reuse", &self.path_reuse, "off", on_or_off)?;

        let mut product = vec![Method::plain(Engine::Embree, None)];
        multiply(&mut product, models, |method, model| method.model = model);
        multiply(&mut product, devices, |method, engine| method.engine = engine);
        multiply(&mut product, traversals, |method, traversal| method.traversal = traversal);
        multiply(&mut product, samplers, |method, sampler| method.sampler = Some(sampler));
        multiply(&mut product, light, |method, light_sampling| method.light_sampling = light_sampling);
        multiply(&mut product, bsdf, |method, bsdf_sampling| method.bsdf_sampling = bsdf_sampling);
        multiply(&mut product, precisions, |method, precision| method.precision = precision);
        multiply(&mut product, pools, |method, pool| method.pool = pool);
        multiply(&mut product, limits, |method, limit| method.clamp_indirect = limit);
        multiply(&mut product, reuse, |method, path_reuse| method.path_reuse = path_reuse);

        let mut methods: Vec<Method> = vec![];
        for method in product.into_iter().map(Method::without_idle_choices) {
            if !methods.contains(&method) {
                methods.push(method);
            }
        }
        Ok(methods)
    }
}

/// A word that is none of those which an axis takes.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{axis} '{word}': expected {expected}")]
pub struct UnknownWord {
    /// The axis, as its flag has it.
    pub axis: &'static str,
    /// The word.
    pub word: String,
    /// What it may be.
    pub expected: &'static str,
}

/// `parse` returns what it expects where it does not know a word.
fn choices<T>(
    axis: &'static str,
    words: &[String],
    default: &str,
    parse: impl Fn(&str) -> Result<T, &'static str>,
) -> Result<Vec<T>, UnknownWord> {
    let parse = |word: &str| parse(word).map_err(|expected| UnknownWord { axis, word: word.to_owned(), expected });
    match words.is_empty() {
        true => Ok(vec![parse(default)?]),
        false => words.iter().map(|word| parse(word)).collect(),
    }
}

fn on_or_off(word: &str) -> Result<bool, &'static str> {
    match word {
        "on" => Ok(true),
        "off" => Ok(false),
        _ => Err("on or off"),
    }
}

/// Each method with each value of an axis.
fn multiply<T: Clone>(methods: &mut Vec<Method>, values: Vec<T>, set: impl Fn(&mut Method, T)) {
    let with = |method: &Method, value: &T| {
        let mut method = method.clone();
        set(&mut method, value.clone());
        method
    };
    *methods = methods.iter().flat_map(|method| values.iter().map(|value| with(method, value))).collect();
}

impl Method {
    /// That of an engine which has no choice.
    fn plain(engine: Engine, model: Option<String>) -> Method {
        Method {
            engine,
            traversal: None,
            sampler: None,
            light_sampling: true,
            bsdf_sampling: BsdfSampling::Lobe,
            path_reuse: false,
            precision: None,
            pool: None,
            model,
            clamp_indirect: None,
        }
    }

    fn without_idle_choices(self) -> Method {
        match self.engine {
            Engine::Vulkan(_) => self,
            // Both sample lights and their materials' lobes, with independent numbers.
            Engine::Embree | Engine::Mitsuba => Method::plain(self.engine, self.model),
        }
    }

    /// Each axis by name, with its value in words.
    pub fn words(&self) -> [(&'static str, String); 10] {
        let on_or_off = |on: bool| String::from(if on { "on" } else { "off" });
        let auto = |word: Option<String>| word.unwrap_or_else(|| "auto".into());
        [
            (
                "device",
                match &self.engine {
                    Engine::Vulkan(name) => name.clone(),
                    Engine::Embree => "embree".into(),
                    Engine::Mitsuba => "mitsuba".into(),
                },
            ),
            ("traversal", auto(self.traversal.map(|traversal| traversal.to_string()))),
            ("sampler", self.sampler.map_or("independent".into(), |sampler| sampler.to_string())),
            ("light-sampling", on_or_off(self.light_sampling)),
            ("bsdf-sampling", self.bsdf_sampling.to_string()),
            ("precision", auto(self.precision.map(|precision| precision.to_string()))),
            ("pool", auto(self.pool.map(|paths| paths.to_string()))),
            ("model", self.model.clone().unwrap_or_else(|| "truth".into())),
            ("clamp-indirect", self.clamp_indirect.map_or("off".into(), |limit| limit.to_string())),
            ("path-reuse", on_or_off(self.path_reuse)),
        ]
    }

    /// Its name among others: the device, and of the other axes those on which they differ.
    pub fn label(&self, others: &[Method]) -> String {
        let chosen = |axis: usize| match (self.words()[axis].0, &self.words()[axis].1) {
            ("light-sampling", word) => format!("lights {word}"),
            ("bsdf-sampling", word) => format!("{word} directions"),
            ("pool", word) => format!("pool {word}"),
            ("clamp-indirect", word) => format!("clamp {word}"),
            ("path-reuse", word) => format!("reuse {word}"),
            (_, word) => word.clone(),
        };
        let idle = |axis: usize| !matches!(self.engine, Engine::Vulkan(_)) && AXES[axis] != "model";
        let differ = |axis: usize| others.iter().any(|other| other.words()[axis].1 != self.words()[axis].1);
        let parts: Vec<String> =
            (0..AXES.len()).filter(|axis| *axis == 0 || (differ(*axis) && !idle(*axis))).map(chosen).collect();
        parts.join(", ")
    }
}

/// All that there is to know about it, fit for a file's name: `llvmpipe+bvh+sobol+on+lobe+auto+auto+truth`, and the limit of indirect
/// light and `on` for paths that are reused, where there is such a thing.
impl fmt::Display for Method {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        let plain = |word: &str| -> String {
            word.chars().map(|char| if char.is_alphanumeric() || "-._".contains(char) { char } else { '_' }).collect()
        };
        let words = self.words().map(|(_, word)| plain(&word));
        // Without either, the names of records that knew of neither.
        let told = match (self.clamp_indirect, self.path_reuse) {
            (_, true) => AXES.len(),
            (Some(_), false) => AXES.len() - 1,
            (None, false) => AXES.len() - 2,
        };
        out.write_str(&words[..told].join("+"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(list: &[&str]) -> Vec<String> {
        list.iter().map(|word| (*word).to_owned()).collect()
    }

    #[test]
    fn axes_multiply_and_idle_choices_do_not() {
        let axes = Axes {
            device: words(&["llvmpipe", "embree"]),
            traversal: words(&["bvh", "ray-query"]),
            sampler: words(&["sobol", "pcg"]),
            light_sampling: words(&["on", "off"]),
            clamp_indirect: words(&["off", "10"]),
            path_reuse: words(&["off", "on"]),
            ..Axes::default()
        };
        let methods = axes.methods().unwrap();
        assert_eq!(methods.len(), 2 * 2 * 2 * 2 * 2 + 1);
        assert_eq!(methods[0].to_string(), "llvmpipe+bvh+sobol+on+lobe+auto+auto+truth");
        assert_eq!(methods[1].to_string(), "llvmpipe+bvh+sobol+on+lobe+auto+auto+truth+off+on");
        assert_eq!(methods[2].to_string(), "llvmpipe+bvh+sobol+on+lobe+auto+auto+truth+10");
        assert_eq!(methods[2].label(&methods), "llvmpipe, bvh, sobol, lights on, clamp 10, reuse off");
        assert_eq!(methods[32].label(&methods), "embree");
        let mut names: Vec<String> = methods.iter().map(|method| method.label(&methods)).collect();
        names.sort();
        names.dedup();
        assert_eq!(names.len(), methods.len());
    }

    #[test]
    fn an_unknown_word_is_told_with_its_axis() {
        for (axis, word, expected) in [
            ("traversal", "octree", "ray-query, bvh or auto"),
            ("sampler", "halton", "sobol or pcg"),
            ("light-sampling", "yes", "on or off"),
            ("bsdf-sampling", "ggx", "lobe, cosine or uniform"),
            ("precision", "bf16", "f32, f16 or auto"),
            ("pool", "0", "at least 1"),
            ("clamp-indirect", "0", "above 0, or off"),
            ("path-reuse", "yes", "on or off"),
        ] {
            let mut axes = Axes::default();
            *axes.axis_mut(axis).unwrap() = words(&[word]);
            let error = axes.methods().unwrap_err().to_string();
            assert!(error.contains(axis) && error.contains(word) && error.contains(expected), "{error}");
        }
    }
}
