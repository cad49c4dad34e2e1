//! Scenes far from the origin, brought back to it, where `f32` is finest.

use std::borrow::Cow;

use glam::{Affine3A, Vec3};

use super::Scene;
use super::mesh::Bounds;

/// Farther from the origin than this many of its own radii, a thing has lost three bits and more of its coordinates.
const FAR: f32 = 8.0;

impl Scene {
    /// The scene with the centre of its bounds at the origin, if that is far away; else the scene itself.
    ///
    /// Nothing is lost on the way: numbers within a factor of two of each other have an exact difference (Sterbenz). What is gained is
    /// all that comes after: hit points, offsets and shadow rays, whose rounding errors grow with the coordinates.
    pub fn recentred(&self) -> Cow<'_, Scene> {
        let bounds = self.bounds();
        if !is_far(&bounds) {
            return Cow::Borrowed(self);
        }
        let center = bounds.center();
        let mut scene = self.clone();
        let mut origins = Vec::with_capacity(scene.meshes.len());
        for (index, mesh) in scene.meshes.iter_mut().enumerate() {
            let stands_alone = self.instances.iter().filter(|instance| instance.mesh as usize == index).all(is_unmoved);
            let bounds = mesh.bounds();
            let origin = match (is_far(&bounds), stands_alone) {
                (false, _) => Vec3::ZERO,
                // Where it is not moved it stays so, which is a kernel the less.
                (true, true) => center,
                (true, false) => bounds.center(),
            };
            mesh.positions.iter_mut().for_each(|position| *position -= origin);
            origins.push(origin);
        }
        for instance in &mut scene.instances {
            let transform = instance.object_to_world;
            let moved = transform.matrix3.as_dmat3() * origins[instance.mesh as usize].as_dvec3();
            let translation = moved + transform.translation.as_dvec3() - center.as_dvec3();
            instance.object_to_world = Affine3A { translation: translation.as_vec3().into(), ..transform };
        }
        scene.camera.eye -= center;
        scene.camera.target -= center;
        Cow::Owned(scene)
    }
}

fn is_far(bounds: &Bounds) -> bool {
    bounds.center().length() > FAR * bounds.radius()
}

fn is_unmoved(instance: &super::Instance) -> bool {
    instance.object_to_world == Affine3A::IDENTITY
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::scene::{Camera, Film, Instance, Mesh};

    fn triangle(offset: Vec3) -> Mesh {
        Mesh {
            positions: [Vec3::ZERO, Vec3::X, Vec3::Y].map(|corner| corner + offset).to_vec(),
            triangles: vec![[0, 1, 2]],
            materials: vec![0],
            ..Mesh::default()
        }
    }

    fn scene(meshes: Vec<Mesh>, transforms: &[Affine3A]) -> Scene {
        let instances = transforms.iter().enumerate();
        Scene {
            camera: Camera { eye: Vec3::Z, target: Vec3::ZERO, up: Vec3::Y, vertical_fov_degrees: 40.0, lens: None },
            film: Film { width: 1, height: 1 },
            instances: instances.map(|(i, t)| Instance { mesh: i as u32, object_to_world: *t }).collect(),
            meshes,
            materials: vec![],
            textures: vec![],
            brdfs: vec![],
            environment: None,
            sun: None,
        }
    }

    /// World positions relative to the eye, in `f64`.
    fn seen(scene: &Scene) -> Vec<DVec3> {
        let corners = scene.instances.iter().flat_map(|instance| {
            let transform = instance.object_to_world;
            let mesh = &scene.meshes[instance.mesh as usize];
            mesh.positions.iter().map(move |position| {
                transform.matrix3.as_dmat3() * position.as_dvec3() + transform.translation.as_dvec3()
            })
        });
        corners.map(|corner| corner - scene.camera.eye.as_dvec3()).collect()
    }

    #[test]
    fn far_scenes_come_to_the_origin_and_look_the_same() {
        let far = Vec3::new(1e6, -2e6, 3e5);
        let turned = Affine3A::from_rotation_y(0.5);
        let there = Affine3A::from_translation(turned.transform_point3(far) * -1.0 + far);
        let mut original = scene(
            vec![triangle(far), triangle(far), triangle(Vec3::ZERO)],
            &[Affine3A::IDENTITY, there * turned, Affine3A::from_translation(far + 3.0)],
        );
        original.camera.eye += far;
        original.camera.target += far;
        let near = original.recentred();
        assert!(near.bounds().center().length() <= near.bounds().radius());
        assert_eq!(near.instances[0].object_to_world, Affine3A::IDENTITY);
        for (a, b) in seen(&original).into_iter().zip(seen(&near)) {
            assert!(a.distance(b) < 1e-6, "{a} {b}");
        }
    }

    #[test]
    fn near_scenes_are_left_alone() {
        let near = scene(vec![triangle(Vec3::splat(2.0))], &[Affine3A::IDENTITY]);
        assert!(matches!(near.recentred(), Cow::Borrowed(_)));
    }
}
