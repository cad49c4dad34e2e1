//! NeuBRDFs, evaluated by definition. The device's form is `glsl/lib/neubrdf.glsl`.

use glam::DVec3;

use super::Query;
use super::half_vector::{half_vector, half_vector_inputs};
use super::network::outputs;
use crate::scene::brdf::{Codebook, Encoding, Footprint, NeuBrdf, POLE};

impl NeuBrdf {
    /// f(wo, wi), see [`super::Evaluate::eval`]; of a material that varies, its average.
    pub fn eval(&self, wo: DVec3, wi: DVec3) -> DVec3 {
        self.eval_at(Footprint::WHOLE, wo, wi)
    }

    /// Whether its values stay as they are when both directions turn about the surface's own normal.
    pub fn is_isotropic_about_z(&self) -> bool {
        self.is_isotropic && self.surface.as_ref().is_none_or(|surface| surface.frames.is_empty())
    }

    /// f(wo, wi) as seen at a place.
    pub fn eval_at(&self, footprint: Footprint, wo: DVec3, wi: DVec3) -> DVec3 {
        let (mut x, received) = self.inputs(Query { footprint, wo, wi });
        if received == 0.0 {
            return DVec3::ZERO;
        }
        for (index, layer) in self.layers.iter().enumerate() {
            let rows = layer.weights.chunks_exact(layer.inputs as usize).zip(&layer.bias);
            let y: Vec<f64> = rows.map(|(row, bias)| dot(row, &x) + f64::from(*bias)).collect();
            x = if index + 1 < self.layers.len() { y.into_iter().map(|y| y.max(0.0)).collect() } else { y };
        }
        received * self.encoding.decode(DVec3::from_slice(&x))
    }

    /// f(wo, wi) of each query, with the network's products taken for many together.
    pub fn eval_many(&self, queries: &[Query]) -> Vec<DVec3> {
        let (inputs, received): (Vec<_>, Vec<_>) = queries.iter().map(|query| self.inputs(*query)).unzip();
        let values = outputs(&self.layers, &inputs).into_iter().zip(received);
        values.map(|(y, received)| received * self.encoding.decode(y)).collect()
    }

    /// What the network sees of directions about the frame of the place, and what that receives of the light: nothing from below.
    fn inputs(&self, Query { footprint, wo, wi }: Query) -> (Vec<f64>, f64) {
        let frame = self.surface.as_ref().and_then(|surface| surface.frame(footprint));
        let ([wo, wi], received) = match frame.map(|frame| frame.turned(wo, wi)) {
            None => ([wo, wi], 1.0),
            Some(turned) => turned.unwrap_or(([wo, wi], 0.0)),
        };
        let [wo, wi] = if self.is_isotropic { turned(wo, wi) } else { [wo, wi] };
        let mut x = Vec::new();
        let places = [self.wi.grid.place(wi), self.wo.grid.place(wo)];
        for (table, at) in self.hemispheres().zip(places.into_iter().cycle()) {
            let gathered = table.gather(at, self.corner_weights);
            let corners = gathered.points.into_iter().zip(gathered.weights);
            push_weighted_sum(&mut x, &table.codebook, &table.indices, corners);
        }
        if let Some(surface) = &self.surface {
            let gathered = surface.grid.gather(footprint);
            let texels = gathered.points.into_iter().zip(gathered.weights);
            push_weighted_sum(&mut x, &surface.codebook, &surface.indices, texels);
        }
        if self.sees_half_vector {
            x.extend(half_vector_inputs(half_vector(wo, wi)));
        }
        (x, received)
    }
}

impl Encoding {
    /// The BRDF, in sr⁻¹, that outputs stand for.
    pub fn decode(&self, y: DVec3) -> DVec3 {
        let [gain, scale, max] = [self.gain, self.scale, self.max].map(f64::from);
        y.map(|y| ((scale * y).exp_m1() / gain).clamp(0.0, max))
    }
}

/// Their scalar product, in partial sums that fill a vector register.
fn dot(weights: &[f32], x: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    for (weights, x) in weights.chunks(8).zip(x.chunks(8)) {
        for ((sum, weight), x) in sums.iter_mut().zip(weights).zip(x) {
            *sum += f64::from(*weight) * x;
        }
    }
    sums.iter().sum()
}

/// Adds the weighted sum of the codes at some points to the end of `x`.
fn push_weighted_sum(x: &mut Vec<f64>, codebook: &Codebook, indices: &[u16], points: impl Iterator<Item = (u32, f64)>) {
    let count = codebook.features as usize;
    let start = x.len();
    x.resize(start + count, 0.0);
    for (point, weight) in points {
        let code = usize::from(indices[point as usize]) * count;
        for (sum, feature) in x[start..].iter_mut().zip(&codebook.codes[code..code + count]) {
            *sum += weight * f64::from(*feature);
        }
    }
}

/// `wo` and `wi` turned about z, and mirrored, so that `wi` has the azimuth 0 and `wo` one in [0, π]; 0 where either is the pole.
pub fn turned(wo: DVec3, wi: DVec3) -> [DVec3; 2] {
    let [flat_o, flat_i] = [wo, wi].map(|w| w.truncate());
    let [rho_o, rho_i] = [flat_o, flat_i].map(|flat| flat.length());
    let is_pole = [flat_o, flat_i].iter().any(|flat| flat.abs().max_element() < POLE);
    let [x, y] =
        if is_pole { [rho_o, 0.0] } else { [flat_o.dot(flat_i), flat_o.perp_dot(flat_i).abs()].map(|x| x / rho_i) };
    [DVec3::new(x, y, wo.z), DVec3::new(rho_i, 0.0, wi.z)]
}
