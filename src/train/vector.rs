//! Short vectors of `f32`.

/// Σ aᵢbᵢ.
pub fn dot(a: &[f32], b: &[f32]) -> f32 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The row of `rows` (count × features) that is nearest to `point`; the first of equals.
pub fn nearest(rows: &[f32], features: usize, point: &[f32]) -> usize {
    let mut best = (0, f32::INFINITY);
    for (index, row) in rows.chunks_exact(features).enumerate() {
        let distance: f32 = row.iter().zip(point).map(|(a, b)| (a - b) * (a - b)).sum();
        if distance < best.1 {
            best = (index, distance);
        }
    }
    best.0
}
