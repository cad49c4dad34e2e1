//! Polygons to triangles.

use glam::{DVec2, DVec3, Vec3};

/// Most corners of a polygon that is not convex: ear clipping takes about the square of their number, in the worst case the cube.
pub(super) const MOST_EARS: usize = 4096;

/// Cuts a polygon of n corners, given by index, into n − 2 triangles of the same orientation: a fan from its first
/// corner if it is convex, otherwise by clipping ears (Meisters 1975) in its mean plane. Self-intersecting polygons are
/// cut somehow. Returns false for a polygon that is not convex and too large, which is cut as if it were convex.
pub(super) fn triangulate(corners: &[u32], positions: &[Vec3], triangles: &mut Vec<[u32; 3]>) -> bool {
    let fan = |triangles: &mut Vec<[u32; 3]>| {
        triangles.extend(corners.windows(2).skip(1).map(|edge| [corners[0], edge[0], edge[1]]));
    };
    if corners.len() <= 3 {
        fan(triangles);
        return true;
    }
    let points = flatten(corners, positions);
    let n = points.len();
    let convex = (0..n).all(|i| turn(points[i], points[(i + 1) % n], points[(i + 2) % n]) >= 0.0);
    if convex || n > MOST_EARS {
        fan(triangles);
        return convex;
    }

    let mut rest: Vec<usize> = (0..n).collect();
    // What lies in a triangle of the outline has a corner there that is not convex; cutting ears makes no more of those.
    let mut reflex: Vec<usize> =
        (0..n).filter(|&i| turn(points[(i + n - 1) % n], points[i], points[(i + 1) % n]) <= 0.0).collect();
    while rest.len() > 3 {
        let around = |i: usize| {
            let count = rest.len();
            [rest[(i + count - 1) % count], rest[i], rest[(i + 1) % count]]
        };
        let is_ear = |&i: &usize| {
            let [a, b, c] = around(i).map(|corner| points[corner]);
            turn(a, b, c) > 0.0
                && !reflex.iter().any(|&other| {
                    around(i).iter().all(|&k| points[k] != points[other]) && inside(points[other], a, b, c)
                })
        };
        let ear = (0..rest.len()).find(is_ear).unwrap_or(0);
        triangles.push(around(ear).map(|corner| corners[corner]));
        let cut = rest.remove(ear);
        reflex.retain(|&corner| corner != cut);
    }
    triangles.push([rest[0], rest[1], rest[2]].map(|corner| corners[corner]));
    true
}

/// A polygon projected along the largest component of its mean normal, so that it runs counter-clockwise.
fn flatten(corners: &[u32], positions: &[Vec3]) -> Vec<DVec2> {
    let point = |i: usize| positions[corners[i % corners.len()] as usize].as_dvec3();
    // Newell's normal: twice the area vector.
    let normal: DVec3 = (0..corners.len()).map(|i| (point(i) - point(0)).cross(point(i + 1) - point(0))).sum();
    let axis = normal.abs().max_position();
    let project = |p: DVec3| match (axis, normal[axis] < 0.0) {
        (0, false) => DVec2::new(p.y, p.z),
        (0, true) => DVec2::new(p.z, p.y),
        (1, false) => DVec2::new(p.z, p.x),
        (1, true) => DVec2::new(p.x, p.z),
        (_, false) => DVec2::new(p.x, p.y),
        (_, true) => DVec2::new(p.y, p.x),
    };
    (0..corners.len()).map(|i| project(point(i))).collect()
}

/// Twice the signed area of a triangle, positive if it runs counter-clockwise.
fn turn(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    (b - a).perp_dot(c - a)
}

fn inside(p: DVec2, a: DVec2, b: DVec2, c: DVec2) -> bool {
    turn(a, b, p) >= 0.0 && turn(b, c, p) >= 0.0 && turn(c, a, p) >= 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The triangles of a polygon in the plane that `place` puts it in: none flipped, their areas its area.
    fn check(outline: &[[f32; 2]], place: impl Fn(Vec3) -> Vec3) {
        let positions: Vec<Vec3> = outline.iter().map(|&[x, y]| place(Vec3::new(x, y, 0.0))).collect();
        // Its length is the areas' scale.
        let normal = (place(Vec3::X) - place(Vec3::ZERO)).cross(place(Vec3::Y) - place(Vec3::ZERO));
        let corners: Vec<u32> = (0..outline.len() as u32).collect();
        let mut triangles = Vec::new();
        assert!(triangulate(&corners, &positions, &mut triangles));
        assert_eq!(triangles.len(), outline.len() - 2);
        let doubled = |i: usize| {
            let ([ax, ay], [bx, by]) = (outline[i].map(f64::from), outline[(i + 1) % outline.len()].map(f64::from));
            ax * by - bx * ay
        };
        let area: f64 = (0..outline.len()).map(doubled).sum::<f64>() / 2.0;
        let mut found = 0.0;
        for triangle in triangles {
            let [a, b, c] = triangle.map(|corner| positions[corner as usize]);
            let signed = (b - a).cross(c - a).dot(normal) / 2.0 / normal.length_squared();
            assert!(signed >= -1e-6, "{triangle:?} is flipped");
            found += f64::from(signed);
        }
        assert!((found - area).abs() < 1e-5, "area {found}, expected {area}");
    }

    #[test]
    fn triangles_tile_their_polygon() {
        let arrow = [[0.0, 0.0], [2.0, -1.0], [0.5, 0.0], [2.0, 1.0]];
        let comb: Vec<[f32; 2]> = (0..20)
            .map(|i| [20.0 - i as f32, if i % 2 == 0 { 1.0 } else { 5.0 }])
            .chain([[0.0, 0.0], [20.0, 0.0]])
            .collect();
        let spiral = [
            [0., 0.],
            [5., 0.],
            [5., 5.],
            [1., 5.],
            [1., 2.],
            [3., 2.],
            [3., 3.],
            [2., 3.],
            [2., 4.],
            [4., 4.],
            [4., 1.],
            [0., 1.],
        ];
        for outline in [&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]][..], &arrow, &comb, &spiral] {
            for start in 0..outline.len() {
                let mut turned = outline.to_vec();
                turned.rotate_left(start);
                check(&turned, |p| p);
                check(&turned, |p| Vec3::new(p.y, p.z, p.x));
                check(&turned, |p| Vec3::new(p.y, p.x, 3.0));
                check(&turned, |p| Vec3::new(p.x, p.x + p.y, -p.y));
            }
        }
    }

    #[test]
    fn large_polygons_keep_their_outline_up_to_a_limit() {
        let star = |corners: usize, inner: f32| -> Vec<[f32; 2]> {
            let angle = |i: usize| std::f32::consts::TAU * i as f32 / corners as f32;
            let radius = |i: usize| if i.is_multiple_of(2) { 1.0 } else { inner };
            (0..corners).map(|i| [radius(i) * angle(i).cos(), radius(i) * angle(i).sin()]).collect()
        };
        check(&star(2000, 0.5), |p| p);
        check(&star(MOST_EARS, 0.9), |p| p);
        let fan = |inner: f32| {
            let outline = star(MOST_EARS + 2, inner);
            let positions: Vec<Vec3> = outline.iter().map(|&[x, y]| Vec3::new(x, y, 0.0)).collect();
            let corners: Vec<u32> = (0..positions.len() as u32).collect();
            let mut triangles = Vec::new();
            let is_cut_well = triangulate(&corners, &positions, &mut triangles);
            assert_eq!(triangles.len(), MOST_EARS);
            is_cut_well
        };
        assert!(fan(1.0));
        assert!(!fan(0.5));
    }
}
