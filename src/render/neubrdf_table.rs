//! NeuBRDFs as the device reads them: `glsl/layout/neubrdf.glsl`, `glsl/lib/neubrdf.glsl`.

use std::collections::HashMap;
use std::mem::offset_of;
use std::sync::Arc;

use bytemuck::cast_slice;
use half::f16;

use super::brdf_table;
use crate::gpu::Device;
use crate::scene::Brdf;
use crate::scene::brdf::{
    Codebook, CornerWeights, Dense, NO_CODE, NeuBrdf, Precision, SphereTable, SurfaceFrames, SurfaceTable,
};

crate::shared_structs! {
    /// The structs of `glsl/layout/neubrdf.glsl` and `glsl/layout/evaluation.glsl`.
    pub const NEUBRDF_STRUCTS;

    /// A hemisphere's features; the GLSL says what the members mean.
    #[allow(missing_docs)]
    pub struct SphereTableRecord {
        pub n_side: u32,
        pub codes: u32,
        pub indices: u32,
        pub levels: u32,
    }

    /// The header of a model; the GLSL says what the members mean.
    #[allow(missing_docs)]
    pub struct NeuBrdfHeader {
        pub wi: SphereTableRecord,
        pub wo: SphereTableRecord,
        pub layers: u32,
        pub is_isotropic: u32,
        pub has_equal_weights: u32,
        pub scale: f32,
        pub most_exponent: f32,
        pub inverse_gain: f32,
        pub surface: u32,
        pub coarser: u32,
    }

    /// A view, two directions of light, above the surface, and where they are: what `eval_neubrdf` and `eval_nbrdf` read.
    #[derive(Default)]
    #[allow(missing_docs)]
    pub struct NeuBrdfQuery {
        pub wo: [f32; 3],
        pub wi_1: [f32; 3],
        pub wi_2: [f32; 3],
        pub uv: [f32; 2],
        pub area: f32,
    }

    /// Their values: what they write.
    #[allow(missing_docs)]
    pub struct NeuBrdfValues {
        pub f_1: [f32; 3],
        pub f_2: [f32; 3],
    }

    /// Their push constants.
    #[allow(missing_docs)]
    pub struct NeuBrdfPush {
        pub table: u64,
        pub queries: u64,
        pub results: u64,
        pub count: u32,
        pub padding: u32,
    }
}

/// Invocations that share loads, at most.
const MOST_LANES: u32 = 8;

/// What a kernel is built for, and all models that it evaluates are filled up to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NeuBrdfShape {
    /// Groups of four features of a direction on one grid.
    feature_groups: u32,
    /// Grids of each hemisphere.
    resolutions: u32,
    /// Groups of four features of a place; 0 where no model varies.
    surface_groups: u32,
    /// Whether places of some model have frames.
    has_frames: bool,
    /// Whether some model sees the half vector.
    sees_half_vector: bool,
    /// Groups of four neurons of each layer but the last.
    hidden_groups: u32,
    layers: u32,
    /// Of codes, weights and biases.
    precision: Precision,
    /// Whether some model is.
    is_isotropic: bool,
    /// Invocations that share loads.
    lanes: u32,
}

impl NeuBrdfShape {
    /// The shape that holds all these models; that of the smallest one if there is none.
    pub fn of<'a>(models: impl IntoIterator<Item = &'a NeuBrdf>, precision: Precision) -> NeuBrdfShape {
        let none = NeuBrdfShape {
            feature_groups: 1,
            resolutions: 1,
            surface_groups: 0,
            has_frames: false,
            sees_half_vector: false,
            hidden_groups: 1,
            layers: 2,
            precision,
            is_isotropic: false,
            lanes: 1,
        };
        models.into_iter().fold(none, |shape, model| {
            let features = model.hemispheres().map(|table| table.codebook.features.div_ceil(4));
            let hidden = model.layers.iter().rev().skip(1).map(|layer| layer.outputs.div_ceil(4));
            NeuBrdfShape {
                feature_groups: features.fold(shape.feature_groups, u32::max),
                resolutions: shape.resolutions.max(model.coarser.len() as u32 + 1),
                surface_groups: shape.surface_groups.max(surface_features(model).div_ceil(4)),
                has_frames: shape.has_frames || has_frames(model),
                sees_half_vector: shape.sees_half_vector || model.sees_half_vector,
                hidden_groups: hidden.fold(shape.hidden_groups, u32::max),
                layers: shape.layers.max(model.layers.len() as u32),
                precision,
                is_isotropic: shape.is_isotropic || model.is_isotropic,
                lanes: shape.lanes,
            }
        })
    }

    /// Whether kernels that are built for it evaluate that model too.
    pub fn holds(&self, model: &NeuBrdf) -> bool {
        let one = NeuBrdfShape::of([model], self.precision);
        one.feature_groups <= self.feature_groups
            && one.resolutions <= self.resolutions
            && one.surface_groups <= self.surface_groups
            && one.has_frames <= self.has_frames
            && one.sees_half_vector <= self.sees_half_vector
            && one.hidden_groups <= self.hidden_groups
            && one.layers <= self.layers
            && one.is_isotropic <= self.is_isotropic
    }

    /// Products of an evaluation.
    pub(super) fn products(&self) -> u32 {
        16 * self.hidden_groups * (self.input_groups() + self.hidden_groups * (self.layers - 2) + 1)
    }

    /// Groups of four inputs: of a place, of directions, of the half vector.
    fn input_groups(&self) -> u32 {
        let half_vector = if self.sees_half_vector { NeuBrdf::HALF_VECTOR_INPUTS / 4 } else { 0 };
        self.surface_groups + 2 * self.resolutions * self.feature_groups + half_vector
    }

    /// Whether its numbers hold those of that model as they are.
    pub fn is_exact_for(&self, model: &NeuBrdf) -> bool {
        self.precision == Precision::F32 || neubrdf_precision([model]) == Precision::F16
    }

    /// The shape for a device. Invocations of CPU drivers share loads: these would not notice that all load the same.
    pub fn on(self, device: &Device) -> NeuBrdfShape {
        let subgroup_size = device.limits().subgroup_size;
        let shares = device.profile().is_cpu && (2..=MOST_LANES).contains(&subgroup_size);
        NeuBrdfShape { lanes: if shares { subgroup_size } else { 1 }, ..self }
    }

    /// The specialization constants of `glsl/layout/neubrdf.glsl`.
    pub fn specialization(&self) -> [(u32, u32); 10] {
        [
            (20, self.feature_groups),
            (21, self.hidden_groups),
            (22, self.layers),
            (23, u32::from(self.precision == Precision::F16)),
            (24, u32::from(self.is_isotropic)),
            (25, self.lanes),
            (28, self.surface_groups),
            (30, u32::from(self.has_frames)),
            (31, self.resolutions),
            (38, u32::from(self.sees_half_vector)),
        ]
    }
}

/// Features of a place; 0 where the model does not vary.
fn surface_features(model: &NeuBrdf) -> u32 {
    model.surface.as_ref().map_or(0, |surface| surface.codebook.features)
}

/// Whether its places have frames.
fn has_frames(model: &NeuBrdf) -> bool {
    model.surface.as_ref().is_some_and(|surface| !surface.frames.is_empty())
}

/// The NeuBRDF that a BRDF is, if it is one.
pub fn neubrdf(brdf: &Brdf) -> Option<&NeuBrdf> {
    if let Brdf::NeuBrdf(model) = brdf { Some(model) } else { None }
}

/// The NeuBRDFs among the BRDFs of a scene.
pub fn neubrdfs(brdfs: &[Arc<Brdf>]) -> impl Iterator<Item = &NeuBrdf> {
    brdfs.iter().filter_map(|brdf| neubrdf(brdf))
}

/// Half precision where it holds all numbers of these models as they are, as it does where files are made so.
pub fn neubrdf_precision<'a>(models: impl IntoIterator<Item = &'a NeuBrdf>) -> Precision {
    let fits = |number: &f32| f16::from_f32(*number).to_f32() == *number;
    let table_fits = |table: &SphereTable| table.codebook.codes.iter().all(fits);
    let layer_fits = |layer: &Dense| layer.weights.iter().chain(&layer.bias).all(fits);
    let surface_fits = |surface: &SurfaceTable| surface.codebook.codes.iter().all(fits);
    let model_fits = |m: &NeuBrdf| {
        m.hemispheres().all(table_fits) && m.surface.iter().all(surface_fits) && m.layers.iter().all(layer_fits)
    };
    if models.into_iter().all(model_fits) { Precision::F16 } else { Precision::F32 }
}

/// Models one after another, each with its lobes before it as `glsl/lib/lobes.glsl` says, and the first word of each: a multiple of
/// four. Its shape holds each. Codebooks and networks that are equal are there once.
pub fn pack_neubrdf_models<'a>(
    models: impl IntoIterator<Item = (&'a NeuBrdf, &'a NeuBrdfShape)>,
) -> (Vec<u32>, Vec<u32>) {
    let models: Vec<_> = models.into_iter().collect();
    pack(&models, |model| brdf_table::pack(&model.lobe, &[]))
}

/// A model's words, for an address that is a multiple of 16. The shape holds it.
pub fn pack_neubrdf(model: &NeuBrdf, shape: &NeuBrdfShape) -> Vec<u32> {
    pack(&[(model, shape)], |_| Vec::new()).0
}

/// Words of a header, behind which the records of coarser grids stand.
const HEADER_WORDS: usize = size_of::<NeuBrdfHeader>() / 4;
const RECORD_WORDS: usize = size_of::<SphereTableRecord>() / 4;

/// Where a record tells how far the codes are from the header, and where a header tells it of the layers.
const CODES: usize = offset_of!(SphereTableRecord, codes) / 4;
const LAYERS: usize = offset_of!(NeuBrdfHeader, layers) / 4;

/// Where the record of a hemisphere is, in words from the header; they are counted by [`NeuBrdf::hemispheres`].
fn record_at(side: usize) -> usize {
    match side {
        0 => offset_of!(NeuBrdfHeader, wi) / 4,
        1 => offset_of!(NeuBrdfHeader, wo) / 4,
        _ => HEADER_WORDS + (side - 2) * RECORD_WORDS,
    }
}

/// Models one after another, each behind some words of its own, multiples of four, and where each begins. Arrays that are used
/// more than once stand behind all models: distances are counted forward.
fn pack(models: &[(&NeuBrdf, &NeuBrdfShape)], before: impl Fn(&NeuBrdf) -> Vec<u32>) -> (Vec<u32>, Vec<u32>) {
    // Of each model the codes of its hemispheres, and the layers behind them.
    let arrays: Vec<Vec<Vec<u32>>> = models
        .iter()
        .map(|(model, shape)| {
            let codes = |table: &SphereTable| filled_codes(&table.codebook, shape.feature_groups);
            let arrays = model.hemispheres().map(codes).chain([pack_layers(model, shape)]);
            arrays.map(|array| numbers(&array, shape.precision)).collect()
        })
        .collect();
    // For each array the headers that will have to know where it is: the word of the distance, and where it is counted from.
    let mut users: HashMap<&[u32], Vec<[usize; 2]>> = HashMap::new();
    arrays.iter().flatten().for_each(|array| users.entry(array).or_default().push([0; 2]));
    users.retain(|_, places| places.len() > 1);
    users.values_mut().for_each(Vec::clear);
    let mut shared: Vec<&[u32]> = Vec::new();

    let (mut words, mut firsts) = (Vec::new(), Vec::new());
    for ((model, shape), arrays) in models.iter().zip(&arrays) {
        firsts.push(words.len() as u32);
        words.append(&mut before(model));
        let header = words.len();
        let layers = arrays.len() - 1;
        let mut own_arrays = Vec::new();
        for (part, array) in arrays.iter().map(Vec::as_slice).enumerate() {
            own_arrays.push(users.get_mut(array).map_or(Some(array), |places| {
                if places.is_empty() {
                    shared.push(array);
                }
                let distance = if part < layers { record_at(part) + CODES } else { LAYERS };
                places.push([header + distance, header]);
                None
            }));
        }
        let mut own = vec![0; record_at(layers)];
        push_model(&mut own, model, shape, &own_arrays);
        words.append(&mut own);
        words.resize(words.len().next_multiple_of(4), 0);
    }
    for array in shared {
        words.resize(words.len().next_multiple_of(4), 0);
        let first = words.len();
        words.extend_from_slice(array);
        for [word, header] in &users[array] {
            words[*word] = ((first - header) / 4) as u32;
        }
        // Subgroups may read a little beyond the end.
        words.extend([0; MOST_LANES as usize]);
    }
    (words, firsts)
}

/// Fills `words`, which hold the place of the header and of the records behind it, with a model: codes of its hemispheres, then layers. Of arrays
/// that stand elsewhere it leaves the distances open.
fn push_model(words: &mut Vec<u32>, model: &NeuBrdf, shape: &NeuBrdfShape, arrays: &[Option<&[u32]>]) {
    let tables = model.hemispheres().zip(arrays);
    let records: Vec<SphereTableRecord> = tables.map(|(table, codes)| push_sphere(words, table, *codes)).collect();
    let (finest, coarser) = records.split_at(2);
    let surface = model.surface.as_ref().map_or(0, |surface| push_surface(words, surface, shape));
    let layers = arrays[records.len()].map_or(0, |layers| {
        let first = push(words, layers);
        // Subgroups may read a little beyond the end.
        words.extend([0; MOST_LANES as usize]);
        first
    });
    let encoding = model.encoding;
    let header = NeuBrdfHeader {
        wi: finest[0],
        wo: finest[1],
        layers,
        is_isotropic: model.is_isotropic.into(),
        has_equal_weights: (model.corner_weights == CornerWeights::Uniform).into(),
        scale: encoding.scale,
        most_exponent: (f64::from(encoding.gain) * f64::from(encoding.max)).ln_1p() as f32,
        inverse_gain: 1.0 / encoding.gain,
        surface,
        coarser: model.coarser.len() as u32,
    };
    words[..HEADER_WORDS].copy_from_slice(cast_slice(std::slice::from_ref(&header)));
    words[HEADER_WORDS..record_at(records.len())].copy_from_slice(cast_slice(coarser));
}

/// Appends an array, and returns where it begins, in groups of four words.
fn push(words: &mut Vec<u32>, array: &[u32]) -> u32 {
    words.resize(words.len().next_multiple_of(4), 0);
    let first = words.len() / 4;
    words.extend_from_slice(array);
    first as u32
}

/// Codes filled up to that many groups of four features.
fn filled_codes(Codebook { features, codes }: &Codebook, groups: u32) -> Vec<f32> {
    let filled = 4 * groups as usize;
    codes
        .chunks_exact(*features as usize)
        .flat_map(|code| code.iter().copied().chain(std::iter::repeat(0.0)).take(filled))
        .collect()
}

/// Appends indices, and returns where they begin.
fn push_indices(words: &mut Vec<u32>, indices: &[u16]) -> u32 {
    // Where there is no code nobody looks; should anybody, it finds one.
    let index = |index: Option<&u16>| index.filter(|index| **index != NO_CODE).map_or(0, |index| u32::from(*index));
    let pairs: Vec<u32> = indices.chunks(2).map(|pair| index(pair.first()) | index(pair.get(1)) << 16).collect();
    push(words, &pairs)
}

/// As `glsl/lib/neubrdf_surface.glsl` reads it.
fn push_surface(words: &mut Vec<u32>, table: &SurfaceTable, shape: &NeuBrdfShape) -> u32 {
    let SurfaceTable { grid, codebook, indices, frames } = table;
    let codes = push(words, &numbers(&filled_codes(codebook, shape.surface_groups), shape.precision));
    let indices = push_indices(words, indices);
    let frames = push_frames(words, frames, grid.point_count());
    let [width, height] = grid.size(0);
    let mut record = vec![width, height, grid.level_count(), codes, indices, frames, 0, 0];
    for level in 0..grid.level_count() {
        let [width, height] = grid.size(level);
        record.extend([width, height, grid.first_point(level), 0]);
    }
    push(words, &record)
}

/// Appends two words a texel, its normal's and its direction's, and returns where they begin; 0 where there are none.
fn push_frames(words: &mut Vec<u32>, frames: &SurfaceFrames, points: usize) -> u32 {
    if frames.is_empty() {
        return 0;
    }
    let word = |[low, high]: [i16; 2]| u32::from(low as u16) | u32::from(high as u16) << 16;
    let frame = |point: usize| {
        let normal = frames.normals.get(point).copied().unwrap_or_default();
        let direction = frames.directions.get(point).copied().unwrap_or([SurfaceFrames::ONE, 0]);
        [normal, direction].map(word)
    };
    push(words, (0..points).map(frame).collect::<Vec<_>>().as_flattened())
}

fn push_sphere(words: &mut Vec<u32>, table: &SphereTable, codes: Option<&[u32]>) -> SphereTableRecord {
    let mut levels = table.levels.clone();
    levels.resize(levels.len().next_multiple_of(4), 0);
    SphereTableRecord {
        n_side: table.grid.n_side(),
        codes: codes.map_or(0, |codes| push(words, codes)),
        indices: push_indices(words, &table.indices),
        levels: if levels.is_empty() {
            0
        } else {
            push(words, &levels.as_chunks().0.iter().map(|bytes| u32::from_le_bytes(*bytes)).collect::<Vec<_>>())
        },
    }
}

/// Numbers as words; what `f16` cannot hold becomes its greatest number.
fn numbers(numbers: &[f32], precision: Precision) -> Vec<u32> {
    match precision {
        Precision::F32 => numbers.iter().map(|number| number.to_bits()).collect(),
        Precision::F16 => {
            let half = |number: f32| u32::from(f16::from_f32(number.clamp(-65504.0, 65504.0)).to_bits());
            numbers.chunks(2).map(|pair| pair.iter().rev().fold(0, |word, number| word << 16 | half(*number))).collect()
        }
    }
}

/// The layers in the order of `glsl/lib/neubrdf.glsl`.
fn pack_layers(model: &NeuBrdf, shape: &NeuBrdfShape) -> Vec<f32> {
    let hidden = 4 * shape.hidden_groups as usize;
    let features = 4 * shape.feature_groups as usize;
    let surface = 4 * shape.surface_groups as usize;
    let resolutions = shape.resolutions as usize;
    // Where the inputs of the first layer go, which here are by hemispheres, and behind them the place's and the half vector's: there the place's come
    // first, then ωo's on all grids, then ωi's, each filled up, then the half vector's.
    let hemisphere = |(side, table): (usize, &SphereTable)| {
        let behind = if side % 2 == 0 { resolutions } else { 0 } + side / 2;
        let first = surface + behind * features;
        first..first + table.codebook.features as usize
    };
    let of_place = 0..surface_features(model) as usize;
    let of_half_vector = surface + 2 * resolutions * features..4 * shape.input_groups() as usize;
    let places: Vec<usize> =
        model.hemispheres().enumerate().map(hemisphere).chain([of_place, of_half_vector]).flatten().collect();
    let mut layers: Vec<Filled> = Vec::new();
    let (last, others) = model.layers.split_last().map_or((None, &[][..]), |(last, others)| (Some(last), others));
    for layer in others {
        let is_first = layers.is_empty();
        let width = if is_first { 4 * shape.input_groups() as usize } else { hidden };
        layers.push(Filled::new(layer, width, hidden, |input| if is_first { places[input] } else { input }));
    }
    // What is not negative passes unchanged through a layer that has ReLU and ones on its diagonal.
    while layers.len() + 1 < shape.layers as usize {
        layers.push(Filled::identity(hidden));
    }
    layers.extend(last.map(|last| Filled::new(last, hidden, 4, |input| input)));

    let mut numbers = Vec::new();
    let (pairs, rest) = layers.as_chunks();
    for [first, second] in pairs {
        numbers.extend_from_slice(&second.bias);
        for block in (0..hidden).step_by(4) {
            let neurons = block..block + 4;
            numbers.extend_from_slice(&first.bias[neurons.clone()]);
            for input in 0..first.inputs {
                numbers.extend(neurons.clone().map(|neuron| first.weight(input, neuron)));
            }
            for output in 0..second.bias.len() {
                numbers.extend(neurons.clone().map(|neuron| second.weight(neuron, output)));
            }
        }
    }
    for last in rest {
        numbers.extend_from_slice(&last.bias);
        for block in (0..last.inputs).step_by(4) {
            for output in 0..3 {
                numbers.extend((block..block + 4).map(|input| last.weight(input, output)));
            }
        }
    }
    numbers
}

/// A layer filled up with zeros.
struct Filled {
    inputs: usize,
    /// outputs × inputs.
    weights: Vec<f32>,
    bias: Vec<f32>,
}

impl Filled {
    /// `place` tells which input an input of `layer` becomes.
    fn new(layer: &Dense, inputs: usize, outputs: usize, place: impl Fn(usize) -> usize) -> Filled {
        let mut filled = Filled { inputs, weights: vec![0.0; inputs * outputs], bias: vec![0.0; outputs] };
        for (output, row) in layer.weights.chunks_exact(layer.inputs as usize).enumerate() {
            row.iter().enumerate().for_each(|(input, weight)| filled.weights[output * inputs + place(input)] = *weight);
        }
        filled.bias[..layer.bias.len()].copy_from_slice(&layer.bias);
        filled
    }

    fn identity(width: usize) -> Filled {
        let weights = (0..width * width).map(|i| if i / width == i % width { 1.0 } else { 0.0 }).collect();
        Filled { inputs: width, weights, bias: vec![0.0; width] }
    }

    fn weight(&self, input: usize, output: usize) -> f32 {
        self.weights[output * self.inputs + input]
    }
}
