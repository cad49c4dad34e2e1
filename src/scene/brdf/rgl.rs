//! The RGL's adaptively parameterised BRDFs, `.bsdf` files in RGB. Dupuy and Jakob, *An Adaptive Parameterization for Efficient
//! Material Acquisition and Rendering*, SIGGRAPH Asia 2018.
//!
//! Directions in the tables are pairs of numbers in [0, 1]: √(2θ/π) across and (φ + π)/2π down.

use std::f32::consts::{FRAC_PI_2, PI, TAU};
use std::path::Path;

use super::tensor_file::{self, F32, TensorFile, U8};
use crate::scene::error::{Error, Place};
use crate::scene::hash::put;
use crate::scene::luminance;

/// Longest description, bytes.
const LONGEST_DESCRIPTION: usize = 1 << 16;
/// Angles may be off by rounding.
const ANGLE_SLACK: f32 = 1e-3;

/// A measured BRDF.
#[derive(Clone, Debug, PartialEq)]
pub struct Rgl {
    tables: RglTables,
    warp: RglWarp,
}

/// What a file holds. All tables have their last dimension fastest, and are interpolated linearly between their entries.
#[derive(Clone, Debug, PartialEq)]
pub struct RglTables {
    /// What the material is called.
    pub description: String,
    /// Azimuths of the viewer in the tables, radians, ascending. At most two: the material is isotropic, and the first
    /// one's tables count. More: they span 2π / [`RglTables::reduction`].
    pub phi: Vec<f32>,
    /// Angles of the viewer to the normal, radians, ascending.
    pub theta: Vec<f32>,
    /// The distribution of microfacet normals: at least 2 × 2 entries over the normal's direction, ≥ 0.
    pub ndf: RglTable,
    /// Their area seen from the viewer, over that of the surface: over the viewer's direction, ≥ 0.
    pub sigma: RglTable,
    /// The density of the normals that the viewer sees, for each of `phi`, each of `theta`: over the normal's direction, ≥ 0.
    pub vndf: RglTable,
    /// f·cos θi·4σ/D, for each of `phi`, each of `theta`, red, green and blue: over the two numbers that the visible normal
    /// is sampled with.
    pub rgb: RglTable,
    /// Whether `rgb` is to be multiplied by D/4σ; otherwise it is f·cos θi itself.
    pub has_jacobian: bool,
}

/// Tables of one size, one after another.
#[derive(Clone, Debug, PartialEq)]
pub struct RglTable {
    /// Entries across, ≥ 2.
    pub width: usize,
    /// Entries down, ≥ 2.
    pub height: usize,
    /// The tables, row by row.
    pub values: Vec<f32>,
}

impl RglTables {
    /// Whether azimuths count by their difference alone.
    pub fn is_isotropic(&self) -> bool {
        self.phi.len() <= 2
    }

    /// By its symmetry, how many times the azimuths that are tabulated make a full circle: 1, 2 (the rest by a half turn) or 4
    /// (by reflection about the axes); always 1 for isotropic materials. The viewer's azimuths then are in [−π, 0], or
    /// [−π, −π/2].
    pub fn reduction(&self) -> u32 {
        match self.phi.as_slice() {
            [first, .., last] if !self.is_isotropic() => (TAU / (last - first)).round() as u32,
            _ => 1,
        }
    }

    fn read(path: &Path, needed_by: Option<&Place>) -> Result<RglTables, Error> {
        let file = TensorFile::read(path, needed_by)?;
        if file.has("spectra") && !file.has("rgb") {
            let expected = "a field `rgb`: the file ending in _rgb.bsdf";
            return Err(Error::unexpected(file.place("spectra"), "a spectral material", expected));
        }
        let ([length], description) = file.field("description", U8)?;
        if length > LONGEST_DESCRIPTION {
            let expected = format!("at most {LONGEST_DESCRIPTION}");
            return Err(Error::unexpected(file.place("description"), format!("{length} bytes"), expected));
        }
        let phi = axis(&file, "phi_i", [-PI, PI])?;
        let theta = axis(&file, "theta_i", [0.0, FRAC_PI_2])?;
        let (shape, values) = file.floats("ndf", [0.0, 1e9])?;
        let ndf = table(&file, "ndf", [], shape, values)?;
        let (shape, values) = file.floats("sigma", [0.0, 1e3])?;
        let sigma = table(&file, "sigma", [], shape, values)?;
        let ([phis, thetas, height, width], values) = file.floats("vndf", [0.0, 1e12])?;
        let vndf = table(&file, "vndf", [(phis, phi.len()), (thetas, theta.len())], [height, width], values)?;
        let ([phis, thetas, channels, height, width], values) = file.floats("rgb", [-1e4, 1e4])?;
        let outer = [(phis, phi.len()), (thetas, theta.len()), (channels, 3)];
        let rgb = table(&file, "rgb", outer, [height, width], values)?;
        let ([phis, thetas, lumin_height, lumin_width], values) = file.floats("luminance", [-1e6, 1e6])?;
        let size = [lumin_height, lumin_width];
        let luminance = table(&file, "luminance", [(phis, phi.len()), (thetas, theta.len())], size, values)?;
        if (luminance.width, luminance.height) != (width, height) {
            let found = format!("{} × {} entries", luminance.width, luminance.height);
            return Err(Error::unexpected(file.place("luminance"), found, format!("{width} × {height}, as for `rgb`")));
        }
        let has_jacobian = match file.field("jacobian", U8)? {
            ([1], [flag @ (0 | 1)]) => *flag == 1,
            ([length], _) => {
                let found = format!("{length} numbers, or another one than 0 and 1");
                return Err(Error::unexpected(file.place("jacobian"), found, "a 0 or a 1"));
            }
        };
        let description = String::from_utf8_lossy(description).into_owned();
        let tables = RglTables { description, phi, theta, ndf, sigma, vndf, rgb, has_jacobian };
        if !matches!(tables.reduction(), 1 | 2 | 4) {
            let found = format!("azimuths from {} to {}", tables.phi[0], tables.phi[tables.phi.len() - 1]);
            return Err(Error::unexpected(file.place("phi_i"), found, "a span of 2π, π or π/2"));
        }
        Ok(tables)
    }

    /// The bytes of a `.bsdf` file.
    pub fn encode(&self) -> Vec<u8> {
        let slices = [self.phi.len(), self.theta.len()];
        let floats = |name, outer: &[usize], inner: Option<&RglTable>, values: &[f32]| {
            let sides = inner.map_or(vec![], |table| vec![table.height, table.width]);
            (name, F32, [outer, &sides].concat(), values.iter().flat_map(|x| x.to_le_bytes()).collect())
        };
        let texels = self.rgb.width * self.rgb.height;
        let gray = |channels: &[f32]| {
            let at = |texel: usize| [0, 1, 2].map(|channel| channels[channel * texels + texel]);
            (0..texels).map(|texel| luminance(at(texel).into())).collect::<Vec<f32>>()
        };
        let luminance: Vec<f32> = self.rgb.values.chunks_exact(3 * texels).flat_map(gray).collect();
        let bytes = |name, bytes: &[u8]| (name, U8, vec![bytes.len()], bytes.to_vec());
        let fields = [
            bytes("description", self.description.as_bytes()),
            floats("phi_i", &[self.phi.len()], None, &self.phi),
            floats("theta_i", &[self.theta.len()], None, &self.theta),
            floats("ndf", &[], Some(&self.ndf), &self.ndf.values),
            floats("sigma", &[], Some(&self.sigma), &self.sigma.values),
            floats("vndf", &slices, Some(&self.vndf), &self.vndf.values),
            floats("luminance", &slices, Some(&self.rgb), &luminance),
            floats("rgb", &[slices[0], slices[1], 3], Some(&self.rgb), &self.rgb.values),
            bytes("jacobian", &[u8::from(self.has_jacobian)]),
        ];
        tensor_file::encode(&fields)
    }
}

impl Rgl {
    /// Integrates what evaluation inverts.
    pub fn new(tables: RglTables) -> Rgl {
        Rgl { warp: RglWarp::new(&tables.vndf), tables }
    }

    /// Reads a `.bsdf` file: an error if it cannot be read, is no tensor file, or if one of its fields is missing, of another type or shape,
    /// or holds a number out of range.
    pub(super) fn read(path: &Path, needed_by: Option<&Place>) -> Result<Rgl, Error> {
        Ok(Rgl::new(RglTables::read(path, needed_by)?))
    }

    /// What the file holds.
    pub fn tables(&self) -> &RglTables {
        &self.tables
    }

    /// Its densities, integrated.
    pub fn warp(&self) -> &RglWarp {
        &self.warp
    }

    pub(super) fn put(&self, hasher: &mut blake3::Hasher) {
        let RglTables { description: _, phi, theta, ndf, sigma, vndf, rgb, has_jacobian } = &self.tables;
        put(hasher, phi);
        put(hasher, theta);
        for RglTable { width, height, values } in [ndf, sigma, vndf, rgb] {
            put(hasher, &[*width as u64, *height as u64]);
            put(hasher, values);
        }
        put(hasher, &[u8::from(*has_jacobian)]);
    }
}

/// The densities of visible normals, integrated: what inverts their sampling.
#[derive(Clone, Debug, PartialEq)]
pub struct RglWarp {
    /// [`RglTables::vndf`], each table times a factor so that the last entry of its `marginal` is 1, or all 0.
    pub density: Vec<f32>,
    /// The integral along each row up to each entry, a number an entry.
    pub conditional: Vec<f32>,
    /// The integral over all rows up to each row, a number a row.
    pub marginal: Vec<f32>,
}

impl RglWarp {
    /// Integrates the densities, which are linear between entries; lengths are in entries.
    pub fn new(densities: &RglTable) -> RglWarp {
        let RglTable { width, height, values } = densities;
        let mut warp = RglWarp { density: Vec::new(), conditional: Vec::new(), marginal: Vec::new() };
        for table in values.chunks_exact(width * height) {
            let row_integrals: Vec<Vec<f64>> = table.chunks_exact(*width).map(running_integral).collect();
            let rows: Vec<f32> = row_integrals.iter().map(|row| row[width - 1] as f32).collect();
            let marginal = running_integral(&rows);
            let total = marginal[height - 1];
            let scale = if total > 0.0 { 1.0 / total } else { 0.0 };
            warp.density.extend(table.iter().map(|x| (f64::from(*x) * scale) as f32));
            warp.conditional.extend(row_integrals.iter().flatten().map(|x| (x * scale) as f32));
            warp.marginal.extend(marginal.iter().map(|x| (x * scale) as f32));
        }
        warp
    }
}

/// ∫ up to each entry of what is linear between entries.
fn running_integral(values: &[f32]) -> Vec<f64> {
    let mut sum = 0.0;
    let mut integral = vec![0.0];
    for pair in values.windows(2) {
        sum += (f64::from(pair[0]) + f64::from(pair[1])) / 2.0;
        integral.push(sum);
    }
    integral
}

/// Ascending angles, at least one.
fn axis(file: &TensorFile, name: &str, [least, most]: [f32; 2]) -> Result<Vec<f32>, Error> {
    let (_, angles): ([usize; 1], _) = file.floats(name, [least - ANGLE_SLACK, most + ANGLE_SLACK])?;
    if angles.is_empty() || angles.windows(2).any(|pair| pair[0] >= pair[1]) {
        let found = format!("{} angles that do not ascend", angles.len());
        return Err(Error::unexpected(file.place(name), found, "at least one angle, each larger than the one before"));
    }
    Ok(angles)
}

/// Tables whose number is the product of `outer`, pairs of what is there and what should be.
fn table<const N: usize>(
    file: &TensorFile,
    name: &str,
    outer: [(usize, usize); N],
    [height, width]: [usize; 2],
    values: Vec<f32>,
) -> Result<RglTable, Error> {
    if outer.iter().any(|(found, expected)| found != expected) || width < 2 || height < 2 {
        let found = outer.map(|(found, _)| found);
        let expected = outer.map(|(_, expected)| expected);
        return Err(Error::unexpected(
            file.place(name),
            format!("{found:?} tables of {height} × {width} entries"),
            format!("{expected:?} of at least 2 × 2"),
        ));
    }
    Ok(RglTable { width, height, values })
}
