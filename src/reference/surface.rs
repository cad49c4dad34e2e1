//! A point on a triangle, recomputed in `f64` from what Embree hit.

use glam::{DAffine3, DMat3, DVec2, DVec3, Vec2, Vec3};

use super::embree::Hit;
use crate::material::{Frame, color, mapped_normal, triangle_derivatives, turned_dpdu, uv_density};
use crate::scene::{Instance, Scene, Surface};

/// An instance's transform, and what follows from it.
pub struct Placement {
    /// `None` stands for the identity.
    transform: Option<Transform>,
}

struct Transform {
    object_to_world: DAffine3,
    world_to_object: DAffine3,
    /// The inverse transpose.
    normal: DMat3,
}

impl Placement {
    /// The placement of an instance.
    pub fn new(instance: &Instance) -> Placement {
        let transform = (instance.object_to_world != glam::Affine3A::IDENTITY).then(|| {
            let object_to_world = instance.object_to_world.as_daffine3();
            let world_to_object = object_to_world.inverse();
            Transform { object_to_world, world_to_object, normal: world_to_object.matrix3.transpose() }
        });
        Placement { transform }
    }

    /// A point in world space.
    pub fn point(&self, object: DVec3) -> DVec3 {
        self.transform.as_ref().map_or(object, |transform| transform.object_to_world.transform_point3(object))
    }

    /// A vector in world space.
    fn vector(&self, object: DVec3) -> DVec3 {
        self.transform.as_ref().map_or(object, |transform| transform.object_to_world.transform_vector3(object))
    }

    /// A normal in world space, not normalised.
    pub fn normal(&self, object: DVec3) -> DVec3 {
        self.transform.as_ref().map_or(object, |transform| transform.normal * object)
    }

    /// A world-space ray in object space.
    fn ray_to_object(&self, origin: DVec3, direction: DVec3) -> (DVec3, DVec3) {
        self.transform.as_ref().map_or((origin, direction), |transform| {
            (transform.world_to_object.transform_point3(origin), transform.world_to_object.transform_vector3(direction))
        })
    }

    /// How far off a point may be to someone who computes in `f32`, each world coordinate: pbrt-v4 §6.8. `weighted` is
    /// Σ|bᵢvᵢ| in object space, or anything larger.
    ///
    /// The hit points here are better than that, but Embree, like the device, sees vertices, rays and transforms in `f32`. The
    /// largest coordinate's bound serves all three: a plane y = 0 has no error in y, and Embree counts a hit at t = 0.
    pub fn error_bound(&self, weighted: DVec3) -> DVec3 {
        let weighted = DVec3::splat(weighted.max_element());
        let interpolation = gamma(7) * weighted;
        let Some(transform) = &self.transform else { return interpolation };
        let forward = transform.object_to_world;
        let absolute = abs(forward.matrix3);
        let world = absolute * weighted + forward.translation.abs();
        // A ray is taken back to object space before it meets the triangle.
        let backward = transform.world_to_object;
        let round_trip = absolute * (abs(backward.matrix3) * world + backward.translation.abs());
        absolute * interpolation + gamma(3) * (world + round_trip)
    }
}

fn abs(matrix: DMat3) -> DMat3 {
    DMat3::from_cols(matrix.x_axis.abs(), matrix.y_axis.abs(), matrix.z_axis.abs())
}

/// The relative error of n roundings in `f32` (Higham 2002).
fn gamma(n: u32) -> f64 {
    let unit = f64::from(n) * f64::from(f32::EPSILON) / 2.0;
    unit / (1.0 - unit)
}

/// Where a ray met a surface.
pub struct SurfacePoint<'a> {
    /// World space.
    pub position: DVec3,
    /// How far off `position` may be.
    pub error: DVec3,
    /// The shading frame.
    pub frame: Frame,
    /// Whether the ray met the front of the triangle.
    pub is_front: bool,
    /// Index into the scene's materials.
    pub material_index: u32,
    /// That material.
    pub material: &'a crate::scene::Material,
    /// The surface's colour here, texture included.
    pub color: DVec3,
    /// What it emits here, were it seen from a side that emits.
    pub emission: DVec3,
    /// What a map says of the roughness along u and v.
    pub roughness: Option<Vec2>,
    /// Texture coordinates.
    pub uv: DVec2,
    /// Area in them of a unit of area.
    pub uv_density: f64,
}

impl<'a> SurfacePoint<'a> {
    /// What a ray from `origin` along `direction` hit. `None` for a triangle without area, which has no normal.
    pub fn new(
        scene: &'a Scene,
        placement: &Placement,
        hit: &Hit,
        origin: DVec3,
        direction: DVec3,
    ) -> Option<SurfacePoint<'a>> {
        let mesh = &scene.meshes[scene.instances[hit.instance as usize].mesh as usize];
        let triangle = hit.triangle as usize;
        let corners = mesh.corners(triangle).map(|corner| corner.as_dvec3());
        let [v0, v1, v2] = corners;
        let object_normal = (v1 - v0).cross(v2 - v0);
        let geometric = placement.normal(object_normal).try_normalize()?;

        let (object_origin, object_direction) = placement.ray_to_object(origin, direction);
        let [u, v] = barycentric(corners, object_origin, object_direction).unwrap_or([hit.u.into(), hit.v.into()]);
        let weights = [1.0 - u - v, u, v];
        let position = weights[0] * v0 + u * v1 + v * v2;
        let weighted = (weights[0] * v0).abs() + (u * v1).abs() + (v * v2).abs();

        let indices = mesh.triangles[triangle].map(|index| index as usize);
        let interpolated = if mesh.normals.is_empty() {
            DVec3::ZERO
        } else {
            let [n0, n1, n2] = indices.map(|index| mesh.normals[index].as_dvec3());
            placement.normal(weights[0] * n0 + u * n1 + v * n2)
        };
        let uvs = (!mesh.uvs.is_empty()).then(|| indices.map(|index| mesh.uvs[index].as_dvec2()));
        let derivatives = uvs.map_or([DVec3::ZERO; 2], |uvs| triangle_derivatives(corners, uvs));
        let derivatives = derivatives.map(|derivative| placement.vector(derivative));

        let uv = uvs.map_or(DVec2::ZERO, |uvs| weights[0] * uvs[0] + u * uvs[1] + v * uvs[2]);
        let edges = [v1 - v0, v2 - v0].map(|edge| placement.vector(edge));
        let uv_density = uv_density(edges, uvs.map(|[a, b, c]| [b - a, c - a]));

        let sample = |texture: u32| scene.textures[texture as usize].sample(uv.as_vec2());
        let whole = mesh.material(triangle);
        let patches = scene.materials[whole as usize].patches.filter(|patches| sample(patches.map).x >= 0.5);
        let material_index = patches.map_or(whole, |patches| patches.material);
        let material = &scene.materials[material_index as usize];
        let reflectance = color(&material.surface);
        let mut surface_color = reflectance.value.as_dvec3();
        if let Some(texture) = reflectance.texture {
            surface_color *= sample(texture).as_dvec3();
        }

        let mut emission = material.emission.as_dvec3();
        if let Some(texture) = material.emission_texture {
            emission *= sample(texture).as_dvec3();
        }

        let shading = material.normal_map.map_or(interpolated, |map| {
            let normal = scene.textures[map as usize].sample_normal(uv.as_vec2());
            mapped_normal(normal.as_dvec3(), interpolated.normalize_or(geometric), derivatives)
        });

        let tangent = material.anisotropy_direction_map.map_or(derivatives[0], |map| {
            let doubled = scene.textures[map as usize].sample_doubled_angle(uv.as_vec2());
            turned_dpdu(doubled.as_dvec2(), shading.normalize_or(geometric), derivatives)
        });

        let wo = -direction;
        let opaque = !matches!(material.surface, Surface::Dielectric { .. });
        Some(SurfacePoint {
            position: placement.point(position),
            error: placement.error_bound(weighted),
            frame: Frame::new(wo, geometric, shading, tangent, opaque),
            is_front: wo.dot(geometric) > 0.0,
            material_index,
            material,
            color: surface_color,
            emission,
            roughness: material.roughness_map.map(|map| sample(map).truncate()),
            uv,
            uv_density,
        })
    }

    /// The origin of a ray that leaves along `direction`.
    pub fn leave(&self, direction: DVec3) -> Vec3 {
        leave(self.position, self.error, self.frame.geometric, direction)
    }
}

/// The barycentric weights u (of v1) and v (of v2) where a line meets a triangle's plane, pulled into the triangle (Möller &
/// Trumbore 1997); `None` if it lies in the plane.
fn barycentric([v0, v1, v2]: [DVec3; 3], origin: DVec3, direction: DVec3) -> Option<[f64; 2]> {
    let (edge1, edge2) = (v1 - v0, v2 - v0);
    let across = direction.cross(edge2);
    let inverse = 1.0 / edge1.dot(across);
    if !inverse.is_finite() {
        return None;
    }
    let from_corner = origin - v0;
    let u = (from_corner.dot(across) * inverse).max(0.0);
    let v = (direction.dot(from_corner.cross(edge1)) * inverse).max(0.0);
    let sum = (u + v).max(1.0);
    Some([u / sum, v / sum])
}

/// A point moved off its surface, to the side that `direction` leads to, by more than its error, and rounded to `f32` away
/// from the surface (pbrt-v4, OffsetRayOrigin).
pub fn leave(position: DVec3, error: DVec3, normal: DVec3, direction: DVec3) -> Vec3 {
    let distance = normal.abs().dot(error).copysign(direction.dot(normal));
    let offset = normal * distance;
    let outward = |position: f64, offset: f64| {
        let moved = (position + offset) as f32;
        match offset {
            _ if offset > 0.0 => moved.next_up(),
            _ if offset < 0.0 => moved.next_down(),
            _ => moved,
        }
    };
    Vec3::new(outward(position.x, offset.x), outward(position.y, offset.y), outward(position.z, offset.z))
}
