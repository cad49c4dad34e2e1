//! Named planes of pixels.

use std::collections::BTreeMap;

/// Names of the planes that every renderer here writes, as tev, Nuke and users of OIDN know them.
///
/// | planes | unit | meaning |
/// |---|---|---|
/// | [`BEAUTY`](plane::BEAUTY) | W·sr⁻¹·m⁻² | mean radiance, linear Rec. 709 |
/// | [`VARIANCE`](plane::VARIANCE) | its square | variance of that mean (not of a sample) |
/// | [`SAMPLES`](plane::SAMPLES) | – | number of samples in the mean, `u32` |
/// | [`ALBEDO`](plane::ALBEDO) | – | mean colour of what is seen first, texture included (white for glass and metals given by η and κ); 0 where nothing is |
/// | [`NORMAL`](plane::NORMAL) | – | mean world-space shading normal of what is seen first, towards the viewer (glass: out of the solid), not renormalised; 0 where nothing is |
/// | [`DEPTH`](plane::DEPTH) | world units | distance along the optical axis, ∞ where nothing is |
/// | [`INSTANCE_ID`](plane::INSTANCE_ID), [`PRIMITIVE_ID`](plane::PRIMITIVE_ID), [`MATERIAL_ID`](plane::MATERIAL_ID) | – | indices, `u32`, [`NO_ID`](plane::NO_ID) where nothing is |
///
/// Depth and ids are those of one ray through the centres of pixel and lens: a mean of them is the depth of nothing.
pub mod plane {
    /// Mean radiance.
    pub const BEAUTY: [&str; 3] = ["R", "G", "B"];
    /// Variance of the mean radiance.
    pub const VARIANCE: [&str; 3] = ["variance.R", "variance.G", "variance.B"];
    /// Number of samples.
    pub const SAMPLES: &str = "samples.Y";
    /// Reflectance of the first surface, for denoisers.
    pub const ALBEDO: [&str; 3] = ["albedo.R", "albedo.G", "albedo.B"];
    /// Shading normal of the first surface, for denoisers.
    pub const NORMAL: [&str; 3] = ["normal.X", "normal.Y", "normal.Z"];
    /// Distance of the first surface along the optical axis.
    pub const DEPTH: &str = "depth.Z";
    /// Index of the instance.
    pub const INSTANCE_ID: &str = "id.instance";
    /// Index of the triangle in its mesh.
    pub const PRIMITIVE_ID: &str = "id.primitive";
    /// Index of the material.
    pub const MATERIAL_ID: &str = "id.material";
    /// The id of nothing.
    pub const NO_ID: u32 = u32::MAX;
}

/// The numbers of a plane, row by row from the top.
#[derive(Clone, Debug, PartialEq)]
pub enum Samples {
    /// Measured quantities.
    F32(Vec<f32>),
    /// Counts and indices.
    U32(Vec<u32>),
}

impl Samples {
    /// How many there are.
    pub fn len(&self) -> usize {
        match self {
            Samples::F32(samples) => samples.len(),
            Samples::U32(samples) => samples.len(),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// A picture: planes of one size under their names. [`plane`] lists the names that renderers use.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Pixels that share each path, and so err alike: 1 where each has its own.
    pub paths_shared_by: u32,
    planes: BTreeMap<String, Samples>,
}

impl Picture {
    /// A picture without planes.
    pub fn new(width: u32, height: u32) -> Picture {
        Picture { width, height, paths_shared_by: 1, planes: BTreeMap::new() }
    }

    /// Number of pixels.
    pub fn pixels(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// Adds a plane, or replaces the one of that name.
    ///
    /// # Panics
    /// If it is not [`pixels`](Picture::pixels) long.
    pub fn set(&mut self, name: impl Into<String>, samples: Samples) {
        let name = name.into();
        assert_eq!(samples.len(), self.pixels(), "plane {name} has the size of its picture");
        self.planes.insert(name, samples);
    }

    /// Adds or replaces three planes of numbers.
    ///
    /// # Panics
    /// If there are not [`pixels`](Picture::pixels) of them.
    pub fn set_rgb(&mut self, names: [&str; 3], pixels: &[[f32; 3]]) {
        for (channel, name) in names.into_iter().enumerate() {
            self.set(name, Samples::F32(pixels.iter().map(|pixel| pixel[channel]).collect()));
        }
    }

    /// Three planes of numbers, pixel by pixel; `None` unless all are there.
    pub fn rgb(&self, names: [&str; 3]) -> Option<Vec<[f32; 3]>> {
        let [red, green, blue] = [self.f32(names[0])?, self.f32(names[1])?, self.f32(names[2])?];
        Some((0..self.pixels()).map(|pixel| [red[pixel], green[pixel], blue[pixel]]).collect())
    }

    /// A plane of numbers; `None` if there is none of that name and kind.
    pub fn f32(&self, name: &str) -> Option<&[f32]> {
        match self.planes.get(name)? {
            Samples::F32(samples) => Some(samples),
            Samples::U32(_) => None,
        }
    }

    /// A plane of counts or indices; `None` if there is none of that name and kind.
    pub fn u32(&self, name: &str) -> Option<&[u32]> {
        match self.planes.get(name)? {
            Samples::U32(samples) => Some(samples),
            Samples::F32(_) => None,
        }
    }

    /// Takes a plane away.
    pub fn remove(&mut self, name: &str) -> Option<Samples> {
        self.planes.remove(name)
    }

    /// The names of all planes, sorted.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.planes.keys().map(String::as_str)
    }

    /// All planes with their names, sorted by name.
    pub fn planes(&self) -> impl Iterator<Item = (&str, &Samples)> {
        self.planes.iter().map(|(name, samples)| (name.as_str(), samples))
    }
}

/// A rectangle of pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Crop {
    /// Its left column.
    pub x: u32,
    /// Its upper row.
    pub y: u32,
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
}

impl Crop {
    /// How many pixels it has.
    pub fn pixel_count(&self) -> u64 {
        u64::from(self.width) * u64::from(self.height)
    }

    /// Whether it has pixels, all of them on a film of this size.
    pub fn fits(&self, film_width: u32, film_height: u32) -> bool {
        let within = |start: u32, length: u32, whole: u32| {
            length > 0 && start.checked_add(length).is_some_and(|end| end <= whole)
        };
        within(self.x, self.width, film_width) && within(self.y, self.height, film_height)
    }
}

impl std::str::FromStr for Crop {
    type Err = String;

    /// `x,y,width,height` in pixels.
    fn from_str(word: &str) -> Result<Self, String> {
        let numbers: Option<Vec<u32>> = word.split(',').map(|number| number.trim().parse().ok()).collect();
        match numbers.as_deref() {
            Some(&[x, y, width, height]) if width > 0 && height > 0 => Ok(Crop { x, y, width, height }),
            _ => Err(format!(
                "'{word}' is no crop: expected x,y,width,height in whole pixels, width and height at least 1"
            )),
        }
    }
}
