//! NBRDF networks: Sztrajman, Rainer, Ritschel and Weyrich, *Neural BRDF Representation and Importance Sampling*, Computer
//! Graphics Forum 40(6), 2021, in the files that come with it.

use std::array;
use std::path::Path;

use super::super::error::{Error, Place, quote};
use super::safetensors::Safetensors;
use super::{npy, picked};

/// A network 6 → 21 → 21 → 3 with ReLU between its layers, from the half vector and the difference vector to
/// ln(1 + BRDF); `material::Nbrdf` has the formula. Kernels are input × output. All numbers are finite and of magnitude at most
/// [`Nbrdf::LARGEST_WEIGHT`].
///
/// It is read from six tensors, `NAME/kernel1`, `NAME/bias1` … `NAME/bias3`, of a safetensors file that holds any number of
/// materials, or from six `.npy` files beside one another, as its authors publish it: `NAME_fc1.npy`, `NAME_b1.npy` …
/// `NAME_b3.npy`, of which any one is to be given.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs)]
pub struct Nbrdf {
    pub kernel_1: [[f32; Nbrdf::HIDDEN]; Nbrdf::INPUTS],
    pub bias_1: [f32; Nbrdf::HIDDEN],
    pub kernel_2: [[f32; Nbrdf::HIDDEN]; Nbrdf::HIDDEN],
    pub bias_2: [f32; Nbrdf::HIDDEN],
    pub kernel_3: [[f32; 3]; Nbrdf::HIDDEN],
    pub bias_3: [f32; 3],
}

impl Nbrdf {
    /// The half vector and the difference vector.
    pub const INPUTS: usize = 6;
    /// Neurons of a hidden layer.
    pub const HIDDEN: usize = 21;
    /// Bound of its numbers, so that none in between can exceed what `f32` holds.
    pub const LARGEST_WEIGHT: f32 = 1e6;

    /// The materials of a safetensors file.
    pub(super) fn names(path: &Path) -> Result<Vec<String>, Error> {
        Ok(Safetensors::read(path, None)?.prefixes().into_iter().map(str::to_owned).collect())
    }

    pub(super) fn from_safetensors(path: &Path, name: Option<&str>, by: Option<&Place>) -> Result<Nbrdf, Error> {
        let file = Safetensors::read(path, by)?;
        let names: Vec<&str> = file.prefixes().into_iter().collect();
        if names.is_empty() {
            let expected = "tensors NAME/kernel1, NAME/bias1 …";
            return Err(Error::unexpected(Place::file(path), "no tensors of a material", expected));
        }
        let name = names[picked(path, name, &names)?];
        Nbrdf::from_tensors(|kind, layer, shape| {
            let tensor = format!("{name}/{kind}{layer}");
            let place = Place { field: Some(quote(&tensor)), ..Place::file(path) };
            check(file.floats(&tensor, shape)?, place)
        })
    }

    /// A safetensors file of this one material.
    pub fn to_safetensors(&self, name: &str) -> Vec<u8> {
        let [inputs, hidden] = [Nbrdf::INPUTS, Nbrdf::HIDDEN];
        let tensors: [(&str, Vec<usize>, &[f32]); 6] = [
            ("kernel1", vec![inputs, hidden], self.kernel_1.as_flattened()),
            ("bias1", vec![hidden], &self.bias_1),
            ("kernel2", vec![hidden, hidden], self.kernel_2.as_flattened()),
            ("bias2", vec![hidden], &self.bias_2),
            ("kernel3", vec![hidden, 3], self.kernel_3.as_flattened()),
            ("bias3", vec![3], &self.bias_3),
        ];
        let mut header = serde_json::Map::new();
        let mut data: Vec<u8> = Vec::new();
        for (tensor, shape, numbers) in tensors {
            let start = data.len();
            data.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
            let entry = serde_json::json!({"dtype": "F32", "shape": shape, "data_offsets": [start, data.len()]});
            header.insert(format!("{name}/{tensor}"), entry);
        }
        let header = serde_json::Value::Object(header).to_string();
        [&(header.len() as u64).to_le_bytes()[..], header.as_bytes(), &data].concat()
    }

    pub(super) fn from_npy(path: &Path, by: Option<&Place>) -> Result<Nbrdf, Error> {
        let file_name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        let endings = ["fc1", "b1", "fc2", "b2", "fc3", "b3"].map(|part| format!("{part}.npy"));
        let Some(start) = endings.iter().find_map(|ending| file_name.strip_suffix(ending.as_str())) else {
            let expected = format!("one of the files NAME_{}", endings.join(", NAME_"));
            return Err(Error::unexpected(Place::file(path), "another name", expected));
        };
        Nbrdf::from_tensors(|kind, layer, shape| {
            let part = if kind == "kernel" { "fc" } else { "b" };
            let file = path.with_file_name(format!("{start}{part}{layer}.npy"));
            check(npy::floats(&file, shape, by)?, Place::file(&file))
        })
    }

    /// Asks for `kernel` and `bias` of the layers 1, 2 and 3, each of a shape.
    fn from_tensors(read: impl Fn(&str, usize, &[u64]) -> Result<Vec<f32>, Error>) -> Result<Nbrdf, Error> {
        fn rows<const R: usize, const C: usize>(numbers: &[f32]) -> [[f32; C]; R] {
            array::from_fn(|row| array::from_fn(|column| numbers[row * C + column]))
        }
        fn row<const C: usize>(numbers: &[f32]) -> [f32; C] {
            array::from_fn(|column| numbers[column])
        }
        let [inputs, hidden] = [Nbrdf::INPUTS as u64, Nbrdf::HIDDEN as u64];
        Ok(Nbrdf {
            kernel_1: rows(&read("kernel", 1, &[inputs, hidden])?),
            bias_1: row(&read("bias", 1, &[hidden])?),
            kernel_2: rows(&read("kernel", 2, &[hidden, hidden])?),
            bias_2: row(&read("bias", 2, &[hidden])?),
            kernel_3: rows(&read("kernel", 3, &[hidden, 3])?),
            bias_3: row(&read("bias", 3, &[3])?),
        })
    }

    /// Everything in it.
    pub(super) fn parts(&self) -> impl Iterator<Item = &[f32]> {
        let Nbrdf { kernel_1, bias_1, kernel_2, bias_2, kernel_3, bias_3 } = self;
        [kernel_1.as_flattened(), bias_1, kernel_2.as_flattened(), bias_2, kernel_3.as_flattened(), bias_3].into_iter()
    }
}

fn check(numbers: Vec<f32>, place: Place) -> Result<Vec<f32>, Error> {
    match numbers.iter().find(|number| number.abs() > Nbrdf::LARGEST_WEIGHT) {
        None => Ok(numbers),
        Some(number) => {
            let expected = format!("numbers of magnitude at most {:e}", Nbrdf::LARGEST_WEIGHT);
            Err(Error::unexpected(place, format!("the weight {number:e}"), expected))
        }
    }
}
