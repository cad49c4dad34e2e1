//! NeuBRDFs, evaluated by definition. The device's form is `glsl/lib/neubrdf.glsl`.

use glam::DVec3;

use crate::scene::brdf::{Codebook, CornerWeights, Footprint, NeuBrdf, POLE, SphereTable, SurfaceTable};

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
        let frame = self.surface.as_ref().and_then(|surface| surface.frame(footprint));
        match frame.map(|frame| frame.turned(wo, wi)) {
            None => self.eval_in_frame(footprint, wo, wi),
            Some(None) => DVec3::ZERO,
            Some(Some(([wo, wi], received))) => received * self.eval_in_frame(footprint, wo, wi),
        }
    }

    /// What the network says of directions about the frame of the place.
    fn eval_in_frame(&self, footprint: Footprint, wo: DVec3, wi: DVec3) -> DVec3 {
        let [wo, wi] = if self.is_isotropic { turned(wo, wi) } else { [wo, wi] };
        let directions = [wi, wo].into_iter().cycle();
        let of_direction = |(table, w)| features(table, w, self.corner_weights);
        let mut x: Vec<f64> = self.hemispheres().zip(directions).flat_map(of_direction).collect();
        x.extend(self.surface.iter().flat_map(|surface| surface_features(surface, footprint)));
        for (index, layer) in self.layers.iter().enumerate() {
            let rows = layer.weights.chunks_exact(layer.inputs as usize).zip(&layer.bias);
            let y: Vec<f64> = rows.map(|(row, bias)| dot(row, &x) + f64::from(*bias)).collect();
            x = if index + 1 < self.layers.len() { y.into_iter().map(|y| y.max(0.0)).collect() } else { y };
        }
        let [gain, scale, max] = [self.encoding.gain, self.encoding.scale, self.encoding.max].map(f64::from);
        DVec3::from_slice(&x).map(|y| ((scale * y).exp_m1() / gain).clamp(0.0, max))
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

/// The weighted sum of the codes at the corners of the pixel of `w`.
fn features(table: &SphereTable, w: DVec3, corner_weights: CornerWeights) -> Vec<f64> {
    let gathered = table.gather(w, corner_weights);
    let corners = gathered.points.into_iter().zip(gathered.weights);
    weighted_sum(&table.codebook, &table.indices, corners)
}

/// The same of the texels about a place.
fn surface_features(table: &SurfaceTable, footprint: Footprint) -> Vec<f64> {
    let gathered = table.grid.gather(footprint);
    let texels = gathered.points.into_iter().zip(gathered.weights);
    weighted_sum(&table.codebook, &table.indices, texels)
}

fn weighted_sum(codebook: &Codebook, indices: &[u16], points: impl Iterator<Item = (u32, f64)>) -> Vec<f64> {
    let count = codebook.features as usize;
    let mut sum = vec![0.0; count];
    for (point, weight) in points {
        let code = usize::from(indices[point as usize]) * count;
        for (sum, feature) in sum.iter_mut().zip(&codebook.codes[code..code + count]) {
            *sum += weight * f64::from(*feature);
        }
    }
    sum
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
