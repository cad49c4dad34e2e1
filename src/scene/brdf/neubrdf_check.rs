//! What makes a NeuBRDF valid.

use super::{Codebook, Dense, Encoding, NO_CODE, NeuBrdf, SamplingLobe, SphereTable, SurfaceFrames, SurfaceTable};

/// What is wrong with a NeuBRDF.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{field}: found {found}, expected {expected}")]
pub struct Flaw {
    /// Which part.
    pub field: String,
    /// What is there.
    pub found: String,
    /// What should be there.
    pub expected: String,
}

impl Flaw {
    pub(super) fn new(field: impl Into<String>, found: impl Into<String>, expected: impl Into<String>) -> Flaw {
        Flaw { field: field.into(), found: found.into(), expected: expected.into() }
    }

    /// The same, of a material of a pack.
    pub(super) fn of_material(self, index: usize) -> Flaw {
        Flaw { field: format!("materials[{index}].{}", self.field), ..self }
    }
}

/// Returns a [`Flaw`] unless the condition holds.
fn expect(
    condition: bool,
    field: &str,
    found: impl FnOnce() -> String,
    expected: impl Into<String>,
) -> Result<(), Flaw> {
    if condition { Ok(()) } else { Err(Flaw::new(field, found(), expected)) }
}

impl NeuBrdf {
    /// The most resolutions besides the finest.
    pub const MAX_COARSER: usize = 3;
    /// The most features of a code.
    pub const MAX_FEATURES: u32 = 32;
    /// The widest layer, and the most inputs of the first.
    pub const MAX_WIDTH: u32 = 128;
    /// The most layers.
    pub const MAX_LAYERS: usize = 8;
    /// What no number on the way to a value may reach, whatever the directions: `f32` holds it.
    const MOST_REACHED: f64 = 1e30;
    /// The greatest exponent, scale · y, that [`Encoding::max`] may stand for.
    const MOST_EXPONENT: f64 = 80.0;

    /// Whether all sizes fit together, indices are in range, numbers finite, and no direction can lead to one that is not.
    /// Every evaluator, on the CPU and the device, relies on it.
    ///
    /// # Errors
    /// What is wrong.
    pub fn validate(&self) -> Result<(), Flaw> {
        let count = self.coarser.len();
        expect(count <= Self::MAX_COARSER, "coarser", || format!("{count} resolutions"), "at most 3")?;
        validate_pair(&self.wi, &self.wo, "")?;
        let mut finer = [&self.wi, &self.wo].map(|table| table.grid.n_side());
        for (index, [wi, wo]) in self.coarser.iter().enumerate() {
            let prefix = format!("coarser[{index}].");
            validate_pair(wi, wo, &prefix)?;
            let n_side = [wi, wo].map(|table| table.grid.n_side());
            let is_coarser = n_side.iter().zip(finer).all(|(n_side, finer)| *n_side < finer);
            expect(is_coarser, &format!("{prefix}n_side"), || format!("{n_side:?}"), format!("less than {finer:?}"))?;
            finer = n_side;
        }
        self.surface.as_ref().map_or(Ok(()), SurfaceTable::validate)?;
        let depth = self.layers.len();
        expect((2..=Self::MAX_LAYERS).contains(&depth), "layers", || format!("{depth} layers"), "2 to 8")?;
        let surface = self.surface.as_ref().map(|surface| &*surface.codebook);
        let codebooks = || self.hemispheres().map(|table| &*table.codebook).chain(surface);
        let half_vector = if self.sees_half_vector { Self::HALF_VECTOR_INPUTS } else { 0 };
        let mut width = codebooks().map(|codebook| codebook.features).sum::<u32>() + half_vector;
        let most = Self::MAX_WIDTH;
        expect(width <= most, "features", || format!("{width} inputs in all"), format!("at most {most}"))?;
        // What is seen of a half vector is at most 1.
        let mut reached = codebooks().map(Codebook::greatest).fold(1.0, f64::max);
        for (index, layer) in self.layers.iter().enumerate() {
            let field = format!("layers[{index}]");
            expect(layer.inputs == width, &field, || format!("{} inputs", layer.inputs), width.to_string())?;
            layer.validate(&field)?;
            reached = layer.reach(reached);
            expect(reached <= Self::MOST_REACHED, &field, || format!("outputs up to {reached:e}"), "at most 1e30")?;
            width = layer.outputs;
        }
        expect(width == 3, "layers", || format!("{width} outputs"), "3")?;
        self.encoding.validate()?;
        let lobe = self.lobe.to_floats();
        let fits = SamplingLobe::from_floats(&lobe).is_some();
        expect(fits, "lobe", || format!("{lobe:?}"), "α and probabilities, in range")?;
        let is_finite = self.provenance.errors.values().all(|error| error.is_finite());
        expect(is_finite, "provenance.errors", || "a number that is not finite".into(), "finite numbers")
    }
}

/// The two tables of a resolution, whose fields begin with `prefix`.
fn validate_pair(wi: &SphereTable, wo: &SphereTable, prefix: &str) -> Result<(), Flaw> {
    wi.validate(&format!("{prefix}wi"))?;
    wo.validate(&format!("{prefix}wo"))?;
    let [of_wi, of_wo] = [wi, wo].map(|table| table.codebook.features);
    expect(of_wi == of_wo, &format!("{prefix}wo.features"), || of_wo.to_string(), "as many as ωi has")
}

impl Encoding {
    fn validate(&self) -> Result<(), Flaw> {
        let Encoding { gain, scale, max } = *self;
        let is_positive = |x: f32| x.is_finite() && x > 0.0;
        expect(
            [gain, scale, max].into_iter().all(is_positive),
            "encoding",
            || format!("{self:?}"),
            "positive numbers",
        )?;
        let exponent = (f64::from(gain) * f64::from(max)).ln_1p();
        expect(
            exponent <= NeuBrdf::MOST_EXPONENT && f64::from(scale) <= 1e6,
            "encoding",
            || format!("{self:?}"),
            "gain · max below e⁸⁰, scale at most 10⁶",
        )
    }
}

impl Dense {
    fn validate(&self, field: &str) -> Result<(), Flaw> {
        let Dense { inputs, outputs, .. } = *self;
        let most = NeuBrdf::MAX_WIDTH;
        expect((1..=most).contains(&outputs), field, || format!("{outputs} outputs"), format!("1 to {most}"))?;
        let [weights, bias] = [self.weights.len(), self.bias.len()];
        expect(
            weights == inputs as usize * outputs as usize && bias == outputs as usize,
            field,
            || format!("{weights} weights and {bias} biases"),
            format!("a weight for each of {inputs} inputs and {outputs} outputs and a bias for each output"),
        )?;
        let is_finite = self.weights.iter().chain(&self.bias).all(|x| x.is_finite());
        expect(is_finite, field, || "a number that is not finite".into(), "finite numbers")
    }

    /// How large an output can be, and any partial sum, when inputs are at most `inputs`.
    fn reach(&self, inputs: f64) -> f64 {
        let rows = self.weights.chunks_exact(self.inputs as usize).zip(&self.bias);
        let row = |(row, bias): (&[f32], &f32)| {
            row.iter().map(|x| f64::from(x.abs()) * inputs).sum::<f64>() + f64::from(bias.abs())
        };
        rows.map(row).fold(0.0, f64::max)
    }
}

impl Codebook {
    /// `name` is what holds it.
    pub(super) fn validate(&self, name: &str) -> Result<(), Flaw> {
        let field = |part: &str| format!("{name}.{part}");
        let most = NeuBrdf::MAX_FEATURES;
        expect(
            (1..=most).contains(&self.features),
            &field("features"),
            || self.features.to_string(),
            format!("1 to {most}"),
        )?;
        let codes = self.code_count();
        let is_whole = self.codes.len() == codes * self.features as usize;
        expect(
            is_whole && (1..usize::from(NO_CODE)).contains(&codes),
            &field("codes"),
            || format!("{} numbers", self.codes.len()),
            format!("1 to 65534 codes of {}", self.features),
        )?;
        expect(
            self.codes.iter().all(|x| x.is_finite()),
            &field("codes"),
            || "a number that is not finite".into(),
            "finite numbers",
        )
    }

    /// The greatest absolute value of a feature.
    fn greatest(&self) -> f64 {
        self.codes.iter().fold(0.0, |greatest, x| greatest.max(f64::from(x.abs())))
    }
}

impl SphereTable {
    fn validate(&self, name: &str) -> Result<(), Flaw> {
        self.codebook.validate(name)?;
        let field = |part: &str| format!("{name}.{part}");
        let codes = self.codebook.code_count();
        let pixels = self.grid.pixel_count();
        let same = |levels: &[u8]| {
            let is_merged = |level, pixels: &[u32]| pixels.iter().all(|p| u32::from(levels[*p as usize]) == level);
            self.grid.merge_where(is_merged) == *levels
        };
        expect(
            self.levels.is_empty() || self.levels.len() == pixels && same(&self.levels),
            &field("levels"),
            || format!("{} levels", self.levels.len()),
            format!("none, or one for each of {pixels} pixels and the same for those that are one"),
        )?;
        let points = self.grid.point_count();
        let count = self.indices.len();
        expect(count == points, &field("indices"), || count.to_string(), format!("one for each of {points} points"))?;
        let mut indices = self.indices.iter().zip(self.grid.corners_of(&self.levels));
        let fits =
            |(index, is_corner): (&u16, bool)| if is_corner { usize::from(*index) < codes } else { *index == NO_CODE };
        let wrong = indices.position(|pair| !fits(pair));
        expect(
            wrong.is_none(),
            &field("indices"),
            || format!("{:?} at {wrong:?}", wrong.map(|point| self.indices[point])),
            format!("an index below {codes} for each corner of a pixel, and {NO_CODE} for other points"),
        )
    }
}

impl SurfaceTable {
    fn validate(&self) -> Result<(), Flaw> {
        self.codebook.validate("surface")?;
        let (codes, points, count) = (self.codebook.code_count(), self.grid.point_count(), self.indices.len());
        expect(count == points, "surface.indices", || count.to_string(), format!("one for each of {points} texels"))?;
        let wrong = self.indices.iter().position(|index| usize::from(*index) >= codes);
        expect(
            wrong.is_none(),
            "surface.indices",
            || format!("{:?} at {wrong:?}", wrong.map(|point| self.indices[point])),
            format!("indices below {codes}"),
        )?;
        self.frames.validate(points)
    }
}

impl SurfaceFrames {
    fn validate(&self, points: usize) -> Result<(), Flaw> {
        let each = |field: &str, pairs: &[[i16; 2]], is_fine: fn([i16; 2]) -> bool, expected: &str| {
            let count = pairs.len();
            let fits = count == 0 || count == points;
            expect(fits, field, || count.to_string(), format!("none, or one for each of {points} texels"))?;
            let wrong = pairs.iter().find(|pair| !is_fine(**pair));
            expect(wrong.is_none(), field, || format!("{wrong:?}"), expected)
        };
        let one = SurfaceFrames::ONE;
        let lean = format!("x and y of unit vectors times {one}, with z at least 1/32");
        each("surface.normals", &self.normals, SurfaceFrames::is_normal, &lean)?;
        let angle = format!("cosines and sines times {one}");
        each("surface.directions", &self.directions, SurfaceFrames::is_direction, &angle)
    }
}
