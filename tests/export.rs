//! The material alone: exported modules give the definition's values, and are what their languages' compilers take.

mod common;
#[path = "common/on_wgpu.rs"]
mod on_wgpu;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

use common::neubrdf_parity::{Deviation, TOLERANCE, compare, hard_directions};
use common::random_neubrdf::{Shape, Stream, random_neubrdf};
use glam::{DVec3, Vec3};
use neubrdf::export::{
    ENTRY_POINT, Error, Exported, ExportedAnswer, ExportedModel, ExportedQuery, Language, Place, Prefix,
};
use neubrdf::material::LobeSampled;
use neubrdf::scene::Brdf;
use neubrdf::scene::brdf::{CornerWeights, Footprint, NeuBrdf, Precision};
use on_wgpu::OnWgpu;
use rayon::prelude::*;

/// An export under the default prefix.
fn export(models: &[(String, NeuBrdf)], language: Language, place: Place) -> Result<Exported, Error> {
    neubrdf::export::export(models, language, place, &Prefix::default())
}

fn shipped(name: &str) -> NeuBrdf {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/materials");
    NeuBrdf::load(&folder.join(name).with_extension("neubrdf"), None).unwrap()
}

/// Models by name, as an export takes them.
fn named(models: &[&NeuBrdf]) -> Vec<(String, NeuBrdf)> {
    models.iter().enumerate().map(|(index, model)| (format!("model {index}"), (*model).clone())).collect()
}

/// Pairs of directions: random ones, and such where something special happens; every third is below the surface or in it.
fn queries(model: &ExportedModel, n_side: u32, random_count: usize, hard_count: usize) -> Vec<ExportedQuery> {
    let mut random = Stream(u64::from(model.first_word) + 29);
    let hard = hard_directions(n_side);
    let query = |wo: Vec3, wi: Vec3| ExportedQuery {
        wo: wo.into(),
        wi: wi.into(),
        model: model.first_word,
        ..ExportedQuery::default()
    };
    let above = |w: DVec3| DVec3::new(w.x, w.y, w.z.max(1e-6)).as_vec3();
    let mut found: Vec<_> =
        (0..random_count).map(|_| query(above(random.direction()), above(random.direction()))).collect();
    for index in 0..hard_count {
        let w = hard[index % hard.len()];
        let other = if index % 3 == 0 { hard[random.below(hard.len())] } else { above(random.direction()) };
        found.push(if index % 2 == 0 { query(w, other) } else { query(other, w) });
    }
    found
}

/// Largest deviation of the values of a model of an export.
fn deviation(brdf: &NeuBrdf, queries: &[ExportedQuery], answers: &[ExportedAnswer]) -> Deviation {
    let pairs = queries.par_iter().zip(answers);
    pairs
        .map(|(query, answer)| {
            let numbers = answer.f.iter().chain([&answer.pdf, &answer.sampled_pdf]);
            assert!(numbers.copied().all(|x| x.is_finite() && x >= 0.0), "{query:?} {answer:?}");
            compare(brdf, Footprint::WHOLE, query.wo, query.wi, answer.f)
        })
        .reduce(Deviation::default, Deviation::merge)
}

/// Exports the models together, and compares each with its definition.
fn check(gpu: &OnWgpu, models: &[&NeuBrdf], precision: Precision, counts: [usize; 2]) {
    let place = Place { group: 1, binding: 2 };
    let exported = export(&named(models), Language::Wgsl, place).unwrap();
    assert_eq!(exported.precision, precision);
    let [random, hard] = counts;
    let both = exported.models.iter().zip(models);
    let all: Vec<_> = both.flat_map(|(model, brdf)| queries(model, brdf.wi.grid.n_side(), random, hard)).collect();
    let answers = gpu.answer(&exported, place, &all);
    let parts = all.chunks(random + hard).zip(answers.chunks(random + hard));
    for ((queries, answers), brdf) in parts.zip(models) {
        let found = deviation(brdf, queries, answers);
        let leans = brdf.surface.as_ref().is_some_and(|surface| !surface.frames.is_empty());
        let has_steps = leans || !brdf.wi.levels.is_empty() || brdf.corner_weights == CornerWeights::Uniform;
        eprintln!("{}: {found:?}", brdf.provenance.source);
        assert!(found.worst <= TOLERANCE && (has_steps || found.at_steps == 0), "{brdf:?}: {found:?}");
    }
}

#[test]
fn wgsl_gives_the_values_of_the_definition_for_100_000_pairs() {
    let Some(gpu) = OnWgpu::new() else { return };
    check(&gpu, &[&random_neubrdf(Shape::FULL, 1)], Precision::F16, [90_000, 10_000]);
}

#[test]
fn wgsl_gives_the_values_of_models_of_all_kinds() {
    let Some(gpu) = OnWgpu::new() else { return };
    let uniform = CornerWeights::Uniform;
    let small = Shape { n_side: 16, features: 8, codes: 60, hidden: &[24, 16, 20], ..Shape::FULL };
    let shapes = [
        Shape { is_isotropic: true, is_pruned: true, ..small },
        Shape { is_isotropic: true, corner_weights: uniform, n_side: 128, ..small },
        Shape { is_pruned: true, corner_weights: uniform, ..small },
        Shape { features: 3, hidden: &[5, 6], n_side: 2, codes: 9, ..small },
        // A feature of its own for each point.
        Shape { features: 1, hidden: &[7], n_side: 1, codes: 9, ..small },
        // Of these, the average over the texture.
        Shape { surface: Some(([8, 4], 5)), ..small },
        Shape { surface: Some(([4, 4], 3)), has_frames: true, is_isotropic: true, ..small },
        Shape { sees_half_vector: true, is_isotropic: true, ..small },
        Shape { sees_half_vector: true, ..small },
    ];
    let models = shapes.map(|shape| random_neubrdf(shape, 5));
    let [isotropic, rings, pruned, few, free, varying, leaning, seeing, seeing_both] = models.each_ref();
    check(&gpu, &[isotropic, rings, pruned], Precision::F16, [2000, 3000]);
    check(&gpu, &[few], Precision::F16, [2000, 3000]);
    check(&gpu, &[few, free], Precision::F16, [2000, 3000]);
    check(&gpu, &[varying, leaning], Precision::F16, [2000, 3000]);
    check(&gpu, &[seeing], Precision::F16, [2000, 3000]);
    check(&gpu, &[seeing_both, pruned], Precision::F16, [2000, 3000]);
    let mut exact = random_neubrdf(small, 7);
    exact.layers[0].weights[0] = 0.1;
    check(&gpu, &[&exact], Precision::F32, [2000, 2000]);
}

#[test]
fn models_of_several_shapes_share_a_module() {
    let Some(gpu) = OnWgpu::new() else { return };
    let models = [shipped("chrome_polished"), random_neubrdf(Shape::FULL, 2), shipped("denim")];
    check(&gpu, &models.each_ref(), Precision::F16, [3000, 1000]);
}

/// A module of a small model.
fn small(language: Language, place: Place) -> Exported {
    let shape = Shape { n_side: 4, features: 4, codes: 60, hidden: &[12, 16, 12], ..Shape::FULL };
    export(&named(&[&random_neubrdf(shape, 3)]), language, place).unwrap()
}

/// What glslangValidator makes of a text, SPIR-V or what it says instead; `None` where it is missing.
fn try_glslang(text: &str, arguments: &[&str]) -> Option<Result<Vec<u8>, String>> {
    let folder = tempfile::tempdir().unwrap();
    let [source, module] = ["source", "module.spv"].map(|name| folder.path().join(name));
    std::fs::write(&source, text).unwrap();
    let mut command = Command::new("glslangValidator");
    command.args(["-V", "--target-env", "vulkan1.1", "-S", "comp", "-o"]).arg(&module).args(arguments).arg(&source);
    match command.output() {
        Ok(output) => {
            let log = String::from_utf8_lossy(&output.stdout).into_owned();
            let is_fine = output.status.success() && !log.contains("WARNING");
            Some(if is_fine { Ok(std::fs::read(module).unwrap()) } else { Err(log) })
        }
        Err(error) => {
            common::skip(format_args!("glslangValidator: {error}"));
            None
        }
    }
}

/// The SPIR-V that glslangValidator makes of a text; `None` where it is missing.
fn glslang(text: &str, arguments: &[&str]) -> Option<Vec<u8>> {
    try_glslang(text, arguments).map(|made| made.unwrap_or_else(|log| panic!("{log}")))
}

/// SPIR-V as WGSL.
fn to_wgsl(spirv: &[u8]) -> String {
    let options = naga::front::spv::Options { adjust_coordinate_space: false, ..Default::default() };
    let module = naga::front::spv::parse_u8_slice(spirv, &options).unwrap();
    let flags = naga::valid::ValidationFlags::all();
    let info = naga::valid::Validator::new(flags, naga::valid::Capabilities::all()).validate(&module).unwrap();
    naga::back::wgsl::write_string(&module, &info, naga::back::wgsl::WriterFlags::empty()).unwrap()
}

#[test]
fn glsl_compiles_and_gives_the_same_values() {
    let place = Place { group: 2, binding: 3 };
    let exported = small(Language::Glsl, place);
    // As a library, in any shader.
    let library = format!("#version 450\n{}\nlayout(local_size_x = 1) in;\nvoid main() {{}}\n", exported.shader);
    glslang(&library, &[]);
    let kernel = format!("#version 450\n#define NEUBRDF_KERNEL\n{}", exported.shader);
    let (Some(spirv), Some(gpu)) = (glslang(&kernel, &[]), OnWgpu::new()) else { return };
    let text = to_wgsl(&spirv).replace("fn main(", &format!("fn {ENTRY_POINT}("));
    let compiled = Exported { shader: text, ..exported };
    let original = small(Language::Wgsl, place);
    let queries = queries(&compiled.models[0], 4, 2000, 2000);
    let [answers, expected] = [&compiled, &original].map(|module| gpu.answer(module, place, &queries));
    for ((answer, expected), query) in answers.iter().zip(&expected).zip(&queries) {
        let numbers =
            |answer: &ExportedAnswer| [answer.f, answer.sampled_wi, [answer.pdf, answer.sampled_pdf, 0.0]].concat();
        for (found, expected) in numbers(answer).into_iter().zip(numbers(expected)) {
            assert!((found - expected).abs() <= 1e-5 * expected.abs().max(0.01), "{answer:?}, {query:?}: {expected:?}");
        }
    }
}

/// HLSL without the zeros that dxc initialises arrays by: glslang does not know them.
fn without_zeros(text: &str) -> String {
    let lines =
        text.lines().map(|line| match line.trim_end().strip_suffix("])0;").and_then(|line| line.split_once(" = ")) {
            Some((declaration, _)) => format!("{declaration};\n"),
            None => format!("{line}\n"),
        });
    lines.collect()
}

#[test]
fn hlsl_compiles() {
    let exported = small(Language::Hlsl, Place { group: 2, binding: 3 });
    glslang(&without_zeros(&exported.shader), &["-D", "-e", ENTRY_POINT]);
}

/// The example in a language of docs/exporting.md.
fn example(language: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/exporting.md");
    let page = std::fs::read_to_string(path).unwrap();
    let begin = format!("```{language}\n");
    page.split(&begin).nth(1).unwrap().split("```").next().unwrap().to_owned()
}

#[test]
fn the_examples_of_the_documentation_compile_and_compute_the_albedo() {
    const COUNT: usize = 4096;
    let place = Place::default();
    let named = [("chrome_polished".to_owned(), shipped("chrome_polished"))];
    let [wgsl, glsl, hlsl] =
        [Language::Wgsl, Language::Glsl, Language::Hlsl].map(|language| export(&named, language, place).unwrap());
    let included = |example: &str, name: &str, module: &str| {
        let line = format!("#include \"{name}\"\n");
        assert!(example.contains(&line), "{example}");
        example.replace(&line, module)
    };
    let hlsl = included(&example("hlsl"), "chrome_polished.hlsl", &without_zeros(&hlsl.shader));
    glslang(&hlsl, &["-D", "-e", "bounce"]);
    let compiled = glslang(&included(&example("glsl"), "chrome_polished.glsl", &glsl.shader), &[]);

    let brdf = &named[0].1;
    let values = Brdf::NeuBrdf(Box::new(brdf.clone()));
    let sampled = LobeSampled { brdf: &values, lobe: &brdf.lobe, footprint: Footprint::WHOLE };
    let golden = [0.8191725f32, 0.6710436, 0.5497005];
    let weight = |i: usize| {
        let u = golden.map(|step| f64::from((0.5 + i as f32 * step).fract()));
        sampled.sample(DVec3::new(0.6, 0.0, 0.8), u).map_or(DVec3::ZERO, |sample| sample.weight)
    };
    let expected = (0..COUNT).map(weight).sum::<DVec3>() / COUNT as f64;
    let Some(gpu) = OnWgpu::new() else { return };
    let modules =
        [(Some(wgsl.shader.clone() + &example("wgsl")), "bounce"), (compiled.map(|spirv| to_wgsl(&spirv)), "main")];
    for (text, entry_point) in modules.iter().filter_map(|(text, entry)| text.as_ref().map(|text| (text, entry))) {
        let bytes = wgsl.bytes();
        let weights = gpu.run::<[f32; 4]>(text, entry_point, &[(place, &bytes)], Place { group: 1, binding: 0 }, COUNT);
        let sum: DVec3 = weights.iter().map(|[r, g, b, _]| Vec3::new(*r, *g, *b).as_dvec3()).sum();
        let found = sum / COUNT as f64;
        assert!((found - expected).abs().max_element() < 1e-3, "{entry_point}: {found}, not {expected}");
    }
}

/// What turns with its frames does not stay as it is when directions turn about z.
#[test]
fn a_description_says_what_is_isotropic_about_z() {
    let plain = Shape { n_side: 2, codes: 9, is_isotropic: true, ..Shape::FULL };
    let leaning = Shape { surface: Some(([4, 4], 3)), has_frames: true, ..plain };
    let models = [plain, leaning].map(|shape| random_neubrdf(shape, 5));
    let exported = export(&named(&models.each_ref()), Language::Glsl, Place::default()).unwrap();
    assert_eq!([0, 1].map(|model| exported.models[model].is_isotropic), [true, false]);
}

#[test]
fn every_language_names_the_three_functions_and_the_buffer() {
    let place = Place { group: 2, binding: 3 };
    let functions = [
        (
            Language::Glsl,
            "set = NEUBRDF_SET, binding = NEUBRDF_BINDING",
            ["vec3 neubrdf_eval(", "float neubrdf_pdf(", "NeuBrdfSample neubrdf_sample("],
        ),
        (Language::Wgsl, "@group(2) @binding(3)", ["fn neubrdf_eval(", "fn neubrdf_pdf(", "fn neubrdf_sample("]),
        (
            Language::Hlsl,
            "register(t3, space2)",
            ["float3 neubrdf_eval(", "float neubrdf_pdf(", "NeuBrdfSample neubrdf_sample("],
        ),
        (
            Language::Msl,
            "[[buffer(3)]]",
            ["metal::float3 neubrdf_eval(", "float neubrdf_pdf(", "NeuBrdfSample neubrdf_sample("],
        ),
    ];
    for (language, binding, names) in functions {
        let text = small(language, place).shader;
        for name in names.iter().chain([&binding]) {
            assert!(text.contains(name), "{language} lacks {name}:\n{text}");
        }
    }
}

/// What a text defines at its top level, where no line is indented, and its macros.
fn names_of(text: &str) -> Vec<&str> {
    let mut names = Vec::new();
    for line in text.lines() {
        let code = line.split("//").next().unwrap();
        if let Some(directive) = code.strip_prefix('#') {
            let mut words = directive.split_whitespace();
            names.extend(words.next().filter(|word| ["define", "ifdef", "ifndef"].contains(word)).and(words.next()));
        } else if code.starts_with(|c: char| c.is_ascii_alphabetic() || c == '}') && !code.starts_with("using ") {
            let declared = match code.strip_prefix("layout(") {
                Some(rest) => rest.split_once(") ").unwrap().1,
                None => code.trim_start_matches("metal::"),
            };
            let declared = declared.split(['(', '=', '{', '[', ':', ';']).next().unwrap();
            names.extend(declared.split([' ', '>', '}']).rfind(|word| !word.is_empty()));
        }
    }
    // The entry point of GLSL, and the end of `layout(local_size_x = 64) in;`.
    names.retain(|name| !["main", "in"].contains(name));
    names
}

#[test]
fn every_name_of_a_module_begins_with_its_prefix() {
    let model = random_neubrdf(Shape { surface: Some(([4, 4], 3)), has_frames: true, ..Shape::FULL }, 5);
    let names = |language, prefix: &str| {
        let prefix = prefix.parse().unwrap();
        let module = neubrdf::export::export(&named(&[&model]), language, Place::default(), &prefix).unwrap();
        names_of(&module.shader).into_iter().map(str::to_owned).collect::<Vec<_>>()
    };
    for language in [Language::Glsl, Language::Wgsl, Language::Hlsl, Language::Msl] {
        let [default, gold] = ["neubrdf", "gold"].map(|prefix| names(language, prefix));
        let begins = |name: &String| ["neubrdf_", "NeuBrdf", "NEUBRDF_"].iter().any(|form| name.starts_with(form));
        assert!(default.iter().all(begins), "{language}: {default:?}");
        assert!(gold.iter().all(|name| name.starts_with("gold_")), "{language}: {gold:?}");
        let apart = |names: &[String]| names.iter().collect::<BTreeSet<_>>().len();
        assert!(apart(&gold) > 50 && apart(&gold) == apart(&default), "{language}: {gold:?}");
        for name in ["gold_eval", "gold_pdf", "gold_sample", "gold_Sample", "gold_sphere_cell"] {
            assert!(gold.iter().any(|found| found == name), "{language} lacks {name}: {gold:?}");
        }
    }
}

/// What an engine may have in a language, and a kernel that asks the first module in even invocations, the second one in odd ones.
fn host(language: Language) -> [&'static str; 2] {
    match language {
        Language::Wgsl => [
            "const PI: f32 = 3.0;\nstruct Lobes { alpha: f32 }\nfn expm1(x: f32) -> f32 { return PI * x; }\n\
             fn ggx_sample(x: f32) -> f32 { return expm1(x); }\n",
            "@group(1) @binding(0) var<storage> directions: array<vec4<f32>>;\n\
             @group(1) @binding(1) var<storage, read_write> answers: array<vec4<f32>>;\n\
             @compute @workgroup_size(64)\n\
             fn both(@builtin(global_invocation_id) id: vec3<u32>) {\n\
                 let wo = directions[2u * id.x].xyz;\n\
                 let wi = directions[2u * id.x + 1u].xyz;\n\
                 var answer = vec4<f32>(gold_eval(0u, wo, wi), gold_pdf(0u, wo, wi));\n\
                 if (id.x & 1u) != 0u {\n\
                     answer = vec4<f32>(neubrdf_eval(0u, wo, wi), neubrdf_pdf(0u, wo, wi));\n\
                 }\n\
                 answers[id.x] = answer;\n\
             }\n",
        ],
        Language::Glsl => [
            "#version 450\nconst float PI = 3.0;\nstruct Lobes { float alpha; };\nvec3 expm1(vec3 x) { return PI * x; }\n\
             vec3 ggx_sample(vec3 wo, vec2 alpha, vec2 u) { return expm1(wo); }\n",
            "layout(local_size_x = 64) in;\n\
             layout(std430, set = 1, binding = 0) readonly buffer Directions { vec4 at[]; } directions;\n\
             layout(std430, set = 1, binding = 1) writeonly buffer Answers { vec4 at[]; } answers;\n\
             void main() {\n\
                 uint i = gl_GlobalInvocationID.x;\n\
                 vec3 wo = directions.at[2u * i].xyz;\n\
                 vec3 wi = directions.at[2u * i + 1u].xyz;\n\
                 answers.at[i] = vec4(gold_eval(0u, wo, wi), gold_pdf(0u, wo, wi));\n\
                 if ((i & 1u) != 0u) {\n\
                     answers.at[i] = vec4(neubrdf_eval(0u, wo, wi), neubrdf_pdf(0u, wo, wi));\n\
                 }\n\
             }\n",
        ],
        Language::Hlsl => [
            "static const float PI = 3.0;\nstruct Lobes { float alpha; };\nfloat3 expm1(float3 x) { return PI * x; }\n\
             uint naga_f2u32(float x) { return uint(x); }\n",
            "RWStructuredBuffer<float4> answers : register(u0, space1);\n\
             [numthreads(64, 1, 1)]\n\
             void both(uint3 id : SV_DispatchThreadID) {\n\
                 float3 w = float3(0.6, 0.0, 0.8);\n\
                 answers[id.x] = float4(gold_eval(0u, w, w), neubrdf_pdf(0u, w, w));\n\
             }\n",
        ],
        Language::Msl => panic!("there is no compiler"),
    }
}

#[test]
fn two_modules_and_the_names_of_an_engine_stand_in_one_shader() {
    let places = [0, 1].map(|binding| Place { group: 0, binding });
    let resolutions = shipped("aluminium_brushed");
    let exact = {
        let mut model =
            random_neubrdf(Shape { n_side: 4, features: 4, codes: 60, hidden: &[12, 16, 12], ..Shape::FULL }, 3);
        model.layers[0].weights[0] = 0.1;
        model
    };
    let models = [&resolutions, &exact];
    let prefixes = ["gold", "neubrdf"].map(|prefix| prefix.parse::<Prefix>().unwrap());
    let modules = |language| {
        let module =
            |i: usize| neubrdf::export::export(&named(&[models[i]]), language, places[i], &prefixes[i]).unwrap();
        [0, 1].map(module)
    };
    let shader = |language| {
        let ([engine, kernel], [gold, default]) = (host(language), modules(language).map(|module| module.shader));
        format!("{engine}{gold}{default}{kernel}")
    };
    glslang(&without_zeros(&shader(Language::Hlsl)), &["-D", "-e", "both"]);
    let compiled = glslang(&shader(Language::Glsl), &[]).map(|spirv| to_wgsl(&spirv));

    let Some(gpu) = OnWgpu::new() else { return };
    let exported = modules(Language::Wgsl);
    let [of_gold, of_default] = [0, 1].map(|i| queries(&exported[i].models[0], models[i].wi.grid.n_side(), 1024, 1024));
    let asked: Vec<_> = of_gold.iter().zip(&of_default).flat_map(|(even, odd)| [*even, *odd]).collect();
    let directions: Vec<[f32; 4]> =
        asked.iter().flat_map(|query| [query.wo, query.wi]).map(|[x, y, z]| [x, y, z, 0.0]).collect();
    let data = exported.each_ref().map(Exported::bytes);
    let of_host = |binding| Place { group: 1, binding };
    let inputs =
        [(places[0], &data[0][..]), (places[1], &data[1][..]), (of_host(0), bytemuck::cast_slice(&directions))];
    for (text, entry_point) in [(Some(shader(Language::Wgsl)), "both"), (compiled, "main")] {
        let Some(text) = text else { continue };
        let answers = gpu.run::<[f32; 4]>(&text, entry_point, &inputs, of_host(1), asked.len());
        for (index, (query, [r, g, b, pdf])) in asked.iter().zip(answers).enumerate() {
            let found = compare(models[index % 2], Footprint::WHOLE, query.wo, query.wi, [r, g, b]);
            assert!(found.worst <= TOLERANCE && pdf >= 0.0, "{entry_point}, {index}: {found:?}");
        }
    }
}

#[test]
fn a_module_may_come_twice_but_no_two_of_one_prefix() {
    let module = |hidden, place| {
        let model = random_neubrdf(Shape { n_side: 2, codes: 9, hidden, ..Shape::FULL }, 1);
        export(&named(&[&model]), Language::Glsl, place).unwrap().shader
    };
    let library = |[a, b]: [&str; 2]| format!("#version 450\n{a}{b}layout(local_size_x = 1) in;\nvoid main() {{}}\n");
    let one = module(&[12, 16], Place::default());
    glslang(&library([&one, &one]), &[]);
    // Of other models, and bound elsewhere.
    for other in [module(&[8, 8], Place::default()), module(&[12, 16], Place { group: 0, binding: 1 })] {
        let Some(made) = try_glslang(&library([&one, &other]), &[]) else { return };
        // glslang puts spaces between the words of an error.
        let log = made.unwrap_err();
        assert!(log.contains("have the prefix neubrdf") && log.replace(' ', "").contains("--prefix"), "{log}");
    }
}

#[test]
fn what_is_no_prefix_is_an_error() {
    for word in ["", "9", "9a", "_a", "a_", "a__b", "a-b", "a b", "gl", "gl_a", "é"] {
        let found = word.parse::<Prefix>().unwrap_err().to_string();
        assert!(found.contains(&format!("'{word}'")) && found.contains("expected"), "{found}");
    }
    // There is a local variable wi_turned, and a function neubrdf_turned.
    let model = random_neubrdf(Shape { n_side: 2, codes: 9, ..Shape::FULL }, 1);
    for language in [Language::Glsl, Language::Wgsl, Language::Hlsl, Language::Msl] {
        let made =
            neubrdf::export::export(&named(&[&model]), language, Place::default(), &"wi".parse::<Prefix>().unwrap());
        assert!(matches!(made, Err(Error::Prefix(_))), "{language}");
    }
}

#[test]
fn what_cannot_be_exported_is_an_error() {
    let model = random_neubrdf(Shape { n_side: 2, codes: 9, ..Shape::FULL }, 1);
    let message = |models: &[(String, NeuBrdf)], place| export(models, Language::Wgsl, place).unwrap_err().to_string();
    assert!(matches!(export(&[], Language::Glsl, Place::default()), Err(Error::Nothing)));
    let far = Place { group: 0, binding: 1000 };
    assert!(message(&named(&[&model]), far).contains("expected at most 200"));
    let mut wrong = model.clone();
    wrong.wo.indices[5] = 9;
    let found = message(&[("rust".into(), wrong)], Place::default());
    assert!(found.contains("rust: wo.indices: found Some(9)"), "{found}");
    let mut infinite = model.clone();
    infinite.layers[1].bias[0] = f32::INFINITY;
    assert!(message(&named(&[&infinite]), Place::default()).contains("layers[1]"));
    // A name is part of a comment, and stays within it.
    let line_breaks = ['\n', '\r', '\u{b}', '\u{c}', '\u{85}', '\u{2028}', '\u{2029}'];
    let named = [(line_breaks.map(|line_break| format!("a{line_break}fn evil() {{}}\\")).concat(), model)];
    for language in [Language::Glsl, Language::Wgsl, Language::Hlsl, Language::Msl] {
        let text = export(&named, language, Place::default()).unwrap().shader;
        assert!(text.split(line_breaks).all(|line| !line.starts_with("fn evil")), "{language}");
    }
}

fn run(arguments: &[&str]) -> (bool, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_neubrdf")).arg("export").args(arguments).output().unwrap();
    (output.status.success(), String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned())
}

#[test]
fn the_command_writes_module_data_and_description() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let text = |path: &Path| path.to_str().unwrap().to_owned();
    let input = text(&Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/materials/denim.neubrdf"));
    let output = text(folder.path());
    let (succeeds, log) = run(&[&input, "--shader", "wgsl", "-o", &output, "--group", "1"]);
    assert!(succeeds, "{log}");
    let expected =
        export(&[("denim".to_owned(), shipped("denim"))], Language::Wgsl, Place { group: 1, binding: 0 }).unwrap();
    assert_eq!(std::fs::read_to_string(at("denim.wgsl")).unwrap(), expected.shader);
    assert_eq!(std::fs::read(at("denim.wgsl.bin")).unwrap(), expected.bytes());
    let description: serde_json::Value =
        serde_json::from_slice(&std::fs::read(at("denim.wgsl.json")).unwrap()).unwrap();
    assert_eq!(description["bytes"], expected.bytes().len());
    assert_eq!(description["models"][0]["first_word"], 0);
    assert_eq!(description["group"], 1);
    assert_eq!(description["prefix"], "neubrdf");
    assert_eq!(description["data"], "denim.wgsl.bin");

    // In another language, of other models, beside it: the first one's data stay its own. A slash asks for a directory.
    let chrome = input.replace("denim", "chrome_polished");
    let (succeeds, log) = run(&[&input, &chrome, "--shader", "glsl", "-o", &output]);
    assert!(succeeds && std::fs::read(at("denim.wgsl.bin")).unwrap() == expected.bytes(), "{log}");
    assert!(std::fs::metadata(at("denim.glsl.bin")).unwrap().len() > expected.bytes().len() as u64);
    let (succeeds, log) = run(&[&input, "--shader", "wgsl", "--group", "1", "-o", &text(&at("new/er/"))]);
    assert!(succeeds && std::fs::read_to_string(at("new/er/denim.wgsl")).unwrap() == expected.shader, "{log}");

    let (succeeds, log) = run(&[&input, "--shader", "hlsl", "--prefix", "gold", "-o", &output]);
    assert!(succeeds && std::fs::read_to_string(at("denim.hlsl")).unwrap().contains("float3 gold_eval("), "{log}");

    let files = || std::fs::read_dir(folder.path()).unwrap().count();
    let before = files();
    let refused = |arguments: &[&str], wanted: &str| {
        let (succeeds, log) = run(arguments);
        assert!(!succeeds && log.contains(wanted), "{log}");
    };
    // A file that is cut, one that is changed, none at all.
    let bytes = std::fs::read(&input).unwrap();
    let broken: PathBuf = at("broken.neubrdf");
    for (content, wanted) in [
        (&bytes[..30], "cut off"),
        (&bytes[..100], "checksum"),
        (&[&bytes[..200], &[1], &bytes[201..]].concat()[..], "checksum"),
    ] {
        std::fs::write(&broken, content).unwrap();
        refused(&[&text(&broken), "--shader", "hlsl", "-o", &output], wanted);
    }
    std::fs::remove_file(&broken).unwrap();
    let recipe = input.replace(".neubrdf", ".toml");
    refused(
        &[&recipe, "--shader", "hlsl", "-o", &output],
        "does not begin as a .neubrdf file, expected a .neubrdf file",
    );
    refused(&[&text(&at("none.neubrdf")), "--shader", "msl", "-o", &output], "none.neubrdf");
    refused(&[&input, "--shader", "spirv", "-o", &output], "expected glsl, wgsl, hlsl or msl");
    for (prefix, wanted) in
        [("a__b", "'a__b' for '--prefix <NAME>'"), ("gl", "expected letters"), ("wi", "another prefix")]
    {
        refused(&[&input, "--shader", "wgsl", "-o", &output, "--prefix", prefix], wanted);
    }
    for (option, value) in [("--prefix", "gold"), ("--group", "1"), ("--binding", "1")] {
        refused(&[&input, "--mitsuba", &text(&at("mitsuba")), option, value], option);
    }
    refused(&[&input, "--shader", "glsl"], "--output");
    refused(&[&input, "--shader", "glsl", "-o", &text(&at("there/denim.glsl"))], "there is no directory");
    refused(
        &[&input, "--shader", "glsl", "-o", &text(&at("denim.wgsl/"))],
        "denim.wgsl/: the directory cannot be made",
    );
    refused(&[&input], "--shader");
    assert_eq!(files(), before, "what fails writes nothing");
}
