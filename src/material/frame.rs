//! The shading frame at a point of a triangle.

use glam::{DMat3, DVec2, DVec3};

use super::surface_frame::half_angle;
use crate::scene::brdf::SurfaceFrame;

/// A right-handed orthonormal frame in world space, and the geometric normal that it was built about.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Local x: along dp/du where there is one.
    pub tangent: DVec3,
    /// Local y: `normal × tangent`.
    pub bitangent: DVec3,
    /// Local z: the shading normal.
    pub normal: DVec3,
    /// The geometric normal, on the same side as `normal` seen from where the ray came.
    pub geometric: DVec3,
}

impl Frame {
    /// The frame for a ray that arrives along −`wo`. The vectors are in world space, of any length; the normals point
    /// to the front of the triangle, transformed by the inverse transpose. A zero vector stands for "none".
    ///
    /// - An interpolated normal that is zero is replaced by the geometric one, one behind the triangle is turned.
    /// - Opaque surfaces turn towards `wo`; the boundary of a solid keeps its normal pointing out.
    /// - Where `wo` is on different sides of the two normals, the geometric one is used.
    /// - `dpdu` gives the tangent; where it is zero or along the normal, [`orthonormal_basis`] does.
    pub fn new(wo: DVec3, geometric: DVec3, interpolated: DVec3, dpdu: DVec3, opaque: bool) -> Frame {
        let mut geometric = geometric.normalize_or_zero();
        let mut normal = interpolated.normalize_or(geometric);
        if normal.dot(geometric) < 0.0 {
            normal = -normal;
        }
        if opaque && wo.dot(geometric) < 0.0 {
            geometric = -geometric;
            normal = -normal;
        }
        if wo.dot(normal) * wo.dot(geometric) <= 0.0 {
            normal = geometric;
        }
        let across = dpdu - normal * normal.dot(dpdu);
        // Less than 10⁻⁵ rad off the normal is rounding error.
        let has_tangent = across.length_squared() > 1e-10 * dpdu.length_squared();
        let tangent = if has_tangent { across.normalize() } else { orthonormal_basis(normal).0 };
        Frame { tangent, bitangent: normal.cross(tangent), normal, geometric }
    }

    /// A world direction in the local frame.
    pub fn to_local(&self, world: DVec3) -> DVec3 {
        DVec3::new(world.dot(self.tangent), world.dot(self.bitangent), world.dot(self.normal))
    }

    /// A local direction in world space.
    pub fn to_world(&self, local: DVec3) -> DVec3 {
        DMat3::from_cols(self.tangent, self.bitangent, self.normal) * local
    }

    /// Whether `wi` is on the same side of the triangle as of the shading normal: light from elsewhere would leak
    /// through, and counts as 0.
    pub fn is_consistent(&self, wi_world: DVec3, wi_local: DVec3) -> bool {
        wi_world.dot(self.geometric) * wi_local.z > 0.0
    }
}

/// A tangent and a bitangent for a unit vector: Duff et al., *Building an Orthonormal Basis, Revisited*, JCGT 6(1),
/// 2017.
pub fn orthonormal_basis(normal: DVec3) -> (DVec3, DVec3) {
    let sign = 1f64.copysign(normal.z);
    let a = -1.0 / (sign + normal.z);
    let b = normal.x * normal.y * a;
    (
        DVec3::new(1.0 + sign * normal.x * normal.x * a, sign * b, -sign * normal.x),
        DVec3::new(b, sign + normal.y * normal.y * a, -normal.y),
    )
}

/// dp/du and dp/dv of a triangle, in the space of its positions; zero where the texture coordinates are degenerate.
pub fn triangle_derivatives(positions: [DVec3; 3], uvs: [DVec2; 3]) -> [DVec3; 2] {
    let (edge1, edge2) = (positions[1] - positions[0], positions[2] - positions[0]);
    let (duv1, duv2) = (uvs[1] - uvs[0], uvs[2] - uvs[0]);
    let determinant = duv1.perp_dot(duv2);
    if determinant == 0.0 {
        return [DVec3::ZERO; 2];
    }
    [(edge1 * duv2.y - edge2 * duv1.y) / determinant, (edge2 * duv1.x - edge1 * duv2.x) / determinant]
}

/// What a normal map says of a shading normal: the texel's x along dp/du, y at right angles to that on the side of dp/dv, z along the unit normal.
/// A texel that points below the surface leans as far as can be; without a dp/du the normal stays.
pub fn mapped_normal(texel: DVec3, normal: DVec3, derivatives: [DVec3; 2]) -> DVec3 {
    let Some([along_u, along_v]) = along_uv(normal, derivatives) else { return normal };
    let local = map_vector(texel);
    (local.x * along_u + local.y * along_v + local.z * normal).normalize()
}

/// What dp/du turns into about a unit normal by a map of directions: `doubled` is (cos 2ψ, sin 2ψ), interpolated, of the angle ψ from dp/du to what is at
/// right angles to it on the side of dp/dv. Where directions cancel, and without a dp/du, it stays.
pub fn turned_dpdu(doubled: DVec2, normal: DVec3, derivatives: [DVec3; 2]) -> DVec3 {
    match along_uv(normal, derivatives) {
        Some([along_u, along_v]) if doubled.length() >= SurfaceFrame::LEAST_DIRECTION => {
            let half = half_angle(doubled);
            half.x * along_u + half.y * along_v
        }
        _ => derivatives[0],
    }
}

/// Along dp/du and, on the side of dp/dv, at right angles to it about a unit normal; `None` without a dp/du.
fn along_uv(normal: DVec3, [dpdu, dpdv]: [DVec3; 2]) -> Option<[DVec3; 2]> {
    let along_u = dpdu.reject_from(normal).try_normalize()?;
    let across = normal.cross(along_u);
    Some([along_u, if across.dot(dpdv) < 0.0 { -across } else { across }])
}

/// The unit vector of a normal map's texel.
pub(super) fn map_vector(texel: DVec3) -> DVec3 {
    let vector = 2.0 * texel - 1.0;
    vector.with_z(vector.z.max(LEAST_Z)).normalize()
}

/// Lowest z of a mapped normal before it is made a unit vector.
const LEAST_Z: f64 = 0.05;
