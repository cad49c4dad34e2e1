//! Embree 3: a two-level tree over a scene's meshes and instances, in robust mode.
//!
//! A mesh that stands once, and where it is (identity transform), is attached to the top level as it is, which spares its
//! rays a transform. Geometry ids of the top level are instance indices either way.

use std::ffi::c_void;
use std::ptr;

use embree::sys::{self, RTCBufferType, RTCFormat, RTCGeometryType, RTCSceneFlags};
use glam::{Affine3A, Vec3};
use rayon::prelude::*;

use super::Error;
use crate::scene::{Mesh, Scene};

/// A ray in world space; `direction` need not be a unit vector, and `t` is in units of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where it starts.
    pub origin: Vec3,
    /// Where it goes.
    pub direction: Vec3,
    /// Hits nearer than this do not count, ≥ 0.
    pub t_min: f32,
    /// Nor do hits beyond this.
    pub t_max: f32,
}

/// Where a ray met a triangle, as Embree found it, in `f32`: the point (1−u−v)·v0 + u·v1 + v·v2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Index into [`Scene::instances`].
    pub instance: u32,
    /// Index into its mesh's triangles.
    pub triangle: u32,
    /// Distance in units of the ray's direction.
    pub t: f32,
    /// Weight of the second corner.
    pub u: f32,
    /// Weight of the third corner.
    pub v: f32,
}

/// How [`Accelerator::trace_rays`] hands rays to Embree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TraceMode {
    /// One by one (`rtcIntersect1`).
    Single,
    /// As streams of 1024 (`rtcIntersect1M`), announced as coherent.
    CoherentStream,
    /// As streams of 1024, announced as incoherent.
    IncoherentStream,
}

/// Embree's trees over a scene: they own copies of what they need.
pub struct Accelerator {
    top: Tree,
    /// The trees of instanced meshes, which `top` refers to.
    _meshes: Vec<Option<Tree>>,
    device: Device,
}

// SAFETY: Embree's handles may be used from any thread, and the trees are not changed after `new`; tracing rays through a
// committed scene is documented as thread-safe.
unsafe impl Send for Accelerator {}
// SAFETY: as above.
unsafe impl Sync for Accelerator {}

impl Accelerator {
    /// Builds the trees.
    pub fn new(scene: &Scene) -> Result<Accelerator, Error> {
        let device = Device::new()?;
        let mut uses = vec![0; scene.meshes.len()];
        scene.instances.iter().for_each(|instance| uses[instance.mesh as usize] += 1);

        let mut flags = RTCSceneFlags::ROBUST;
        if scene.has_holes() {
            flags |= RTCSceneFlags::CONTEXT_FILTER_FUNCTION;
        }
        let top = Tree::new(&device, flags)?;
        let mut meshes: Vec<Option<Tree>> = scene.meshes.iter().map(|_| None).collect();
        for (id, instance) in scene.instances.iter().enumerate() {
            let index = instance.mesh as usize;
            let mesh = &scene.meshes[index];
            if mesh.triangles.is_empty() {
                continue;
            }
            if uses[index] == 1 && instance.object_to_world == Affine3A::IDENTITY {
                top.attach(&Geometry::triangles(&device, mesh)?, id as u32);
                continue;
            }
            let tree = match &mut meshes[index] {
                Some(tree) => tree,
                none => {
                    let tree = Tree::new(&device, flags)?;
                    tree.attach(&Geometry::triangles(&device, mesh)?, 0);
                    tree.commit(&device)?;
                    none.insert(tree)
                }
            };
            top.attach(&Geometry::instance(&device, tree, instance.object_to_world)?, id as u32);
        }
        top.commit(&device)?;
        Ok(Accelerator { top, _meshes: meshes, device })
    }

    /// Embree's version, such as "3.13.5".
    pub fn version(&self) -> String {
        use sys::RTCDeviceProperty::{VERSION_MAJOR, VERSION_MINOR, VERSION_PATCH};
        [VERSION_MAJOR, VERSION_MINOR, VERSION_PATCH]
            // SAFETY: the device is alive, and these are properties that can be asked for.
            .map(|property| unsafe { sys::rtcGetDeviceProperty(self.device.0, property) }.to_string())
            .join(".")
    }

    /// The nearest hit.
    pub fn closest(&self, ray: &Ray) -> Option<Hit> {
        let mut ray_hit = ray_hit(ray);
        let mut context = context(sys::RTCIntersectContextFlags::INCOHERENT);
        // SAFETY: the tree is committed and alive; both structs are initialised and live beyond the call.
        unsafe { sys::rtcIntersect1(self.top.0, &mut context, &mut ray_hit) };
        hit(&ray_hit.ray, &ray_hit.hit)
    }

    /// Whether anything is in the way.
    pub fn occluded(&self, ray: &Ray) -> bool {
        let mut ray = rtc_ray(ray);
        let mut context = context(sys::RTCIntersectContextFlags::INCOHERENT);
        // SAFETY: as in `closest`.
        unsafe { sys::rtcOccluded1(self.top.0, &mut context, &mut ray) };
        ray.tfar == f32::NEG_INFINITY
    }

    /// The nearest hit of those that `counts` says count, in a scene with holes. It may be asked of a hit several times, in any order.
    pub(super) fn closest_of(&self, ray: &Ray, counts: &dyn Fn(&Hit) -> bool) -> Option<Hit> {
        let mut ray_hit = ray_hit(ray);
        let mut sieve = Sieve::new(counts);
        // SAFETY: as in `closest`; the context is the sieve's first member, and the sieve lives beyond the call.
        unsafe { sys::rtcIntersect1(self.top.0, (&raw mut sieve).cast(), &mut ray_hit) };
        hit(&ray_hit.ray, &ray_hit.hit)
    }

    /// Whether anything is in the way that counts.
    pub(super) fn occluded_by(&self, ray: &Ray, counts: &dyn Fn(&Hit) -> bool) -> bool {
        let mut ray = rtc_ray(ray);
        let mut sieve = Sieve::new(counts);
        // SAFETY: as in `closest_of`.
        unsafe { sys::rtcOccluded1(self.top.0, (&raw mut sieve).cast(), &mut ray) };
        ray.tfar == f32::NEG_INFINITY
    }

    /// The nearest hit of each ray, on all threads of rayon's pool; for measuring Embree's speed.
    ///
    /// # Panics
    /// If there are more or fewer hits than rays.
    pub fn trace_rays(&self, rays: &[Ray], mode: TraceMode, hits: &mut [Option<Hit>]) {
        const STREAM: usize = 1024;
        assert_eq!(hits.len(), rays.len());
        hits.par_chunks_mut(STREAM).zip(rays.par_chunks(STREAM)).for_each(|(hits, rays)| {
            let flags = match mode {
                TraceMode::Single => {
                    hits.iter_mut().zip(rays).for_each(|(hit, ray)| *hit = self.closest(ray));
                    return;
                }
                TraceMode::CoherentStream => sys::RTCIntersectContextFlags::COHERENT,
                TraceMode::IncoherentStream => sys::RTCIntersectContextFlags::INCOHERENT,
            };
            let mut stream: Vec<sys::RTCRayHit> = rays.iter().map(ray_hit).collect();
            let mut context = context(flags);
            // SAFETY: as in `closest`; the stream holds as many rays as it says, at their size's distance.
            unsafe {
                sys::rtcIntersect1M(
                    self.top.0,
                    &mut context,
                    stream.as_mut_ptr(),
                    stream.len() as u32,
                    size_of::<sys::RTCRayHit>(),
                );
            }
            hits.iter_mut().zip(&stream).for_each(|(slot, found)| *slot = hit(&found.ray, &found.hit));
        });
    }
}

/// What Embree calls no geometry.
const NOTHING: u32 = u32::MAX;

fn rtc_ray(ray: &Ray) -> sys::RTCRay {
    sys::RTCRay {
        org_x: ray.origin.x,
        org_y: ray.origin.y,
        org_z: ray.origin.z,
        tnear: ray.t_min,
        dir_x: ray.direction.x,
        dir_y: ray.direction.y,
        dir_z: ray.direction.z,
        time: 0.0,
        tfar: ray.t_max,
        mask: u32::MAX,
        id: 0,
        flags: 0,
    }
}

fn ray_hit(ray: &Ray) -> sys::RTCRayHit {
    let hit = sys::RTCHit {
        Ng_x: 0.0,
        Ng_y: 0.0,
        Ng_z: 0.0,
        u: 0.0,
        v: 0.0,
        primID: NOTHING,
        geomID: NOTHING,
        instID: [NOTHING],
    };
    sys::RTCRayHit { ray: rtc_ray(ray), hit }
}

fn context(flags: sys::RTCIntersectContextFlags) -> sys::RTCIntersectContext {
    sys::RTCIntersectContext { flags, filter: None, instID: [NOTHING] }
}

fn hit(ray: &sys::RTCRay, hit: &sys::RTCHit) -> Option<Hit> {
    let instance = if hit.instID[0] == NOTHING { hit.geomID } else { hit.instID[0] };
    (hit.geomID != NOTHING).then_some(Hit { instance, triangle: hit.primID, t: ray.tfar, u: hit.u, v: hit.v })
}

/// A context that asks of each hit whether it counts.
#[repr(C)]
struct Sieve<'a> {
    /// What Embree sees of it, and hands on to `sift`.
    context: sys::RTCIntersectContext,
    counts: &'a dyn Fn(&Hit) -> bool,
}

impl<'a> Sieve<'a> {
    fn new(counts: &'a dyn Fn(&Hit) -> bool) -> Sieve<'a> {
        let context = context(sys::RTCIntersectContextFlags::INCOHERENT);
        Sieve { context: sys::RTCIntersectContext { filter: Some(sift), ..context }, counts }
    }
}

/// Embree's question whether a hit counts.
///
/// # Safety
/// Called by Embree for one ray, with the context of a [`Sieve`].
unsafe extern "C" fn sift(arguments: *const sys::RTCFilterFunctionNArguments) {
    // SAFETY: as the caller says: a packet of one ray is laid out as a single one, and so is its hit.
    unsafe {
        let arguments = &*arguments;
        let sieve = &*arguments.context.cast::<Sieve>();
        let found = hit(&*arguments.ray.cast::<sys::RTCRay>(), &*arguments.hit.cast::<sys::RTCHit>());
        if !found.is_some_and(|found| (sieve.counts)(&found)) {
            *arguments.valid = 0;
        }
    }
}

/// An Embree device, released when dropped.
struct Device(sys::RTCDevice);

impl Device {
    fn new() -> Result<Device, Error> {
        // SAFETY: a null configuration asks for the defaults.
        let handle = unsafe { sys::rtcNewDevice(ptr::null()) };
        if handle.is_null() {
            // SAFETY: a null device asks for this thread's error.
            let code = unsafe { sys::rtcGetDeviceError(ptr::null_mut()) };
            return Err(Error::Embree(format!("cannot create a device: {code:?}")));
        }
        Ok(Device(handle))
    }

    /// The first error since the last check.
    fn check(&self, doing: &str) -> Result<(), Error> {
        // SAFETY: the device is alive.
        match unsafe { sys::rtcGetDeviceError(self.0) } {
            sys::RTCError::NONE => Ok(()),
            sys::RTCError::OUT_OF_MEMORY => Err(Error::Embree(format!("out of memory while {doing}"))),
            code => Err(Error::Embree(format!("{code:?} while {doing}"))),
        }
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        // SAFETY: it is released once; scenes hold their own references.
        unsafe { sys::rtcReleaseDevice(self.0) };
    }
}

/// An Embree scene, released when dropped.
struct Tree(sys::RTCScene);

impl Tree {
    fn new(device: &Device, flags: RTCSceneFlags) -> Result<Tree, Error> {
        // SAFETY: the device is alive.
        let handle = unsafe { sys::rtcNewScene(device.0) };
        if handle.is_null() {
            device.check("creating a scene")?;
            return Err(Error::Embree("cannot create a scene".to_owned()));
        }
        // SAFETY: the scene is alive and not committed yet.
        unsafe { sys::rtcSetSceneFlags(handle, flags) };
        Ok(Tree(handle))
    }

    fn attach(&self, geometry: &Geometry, id: u32) {
        // SAFETY: both are alive and of one device; the scene takes its own reference.
        unsafe { sys::rtcAttachGeometryByID(self.0, geometry.0, id) };
    }

    fn commit(&self, device: &Device) -> Result<(), Error> {
        // SAFETY: the scene is alive and no other thread uses it yet.
        unsafe { sys::rtcCommitScene(self.0) };
        device.check("building a tree")
    }
}

impl Drop for Tree {
    fn drop(&mut self) {
        // SAFETY: it is released once.
        unsafe { sys::rtcReleaseScene(self.0) };
    }
}

/// An Embree geometry, released when dropped; scenes that it is attached to keep it alive.
struct Geometry(sys::RTCGeometry);

impl Geometry {
    fn new(device: &Device, kind: RTCGeometryType) -> Result<Geometry, Error> {
        // SAFETY: the device is alive.
        let handle = unsafe { sys::rtcNewGeometry(device.0, kind) };
        if handle.is_null() {
            device.check("creating a geometry")?;
            return Err(Error::Embree("cannot create a geometry".to_owned()));
        }
        Ok(Geometry(handle))
    }

    fn triangles(device: &Device, mesh: &Mesh) -> Result<Geometry, Error> {
        let geometry = Geometry::new(device, RTCGeometryType::TRIANGLE)?;
        let positions = bytemuck::cast_slice::<Vec3, [f32; 3]>(&mesh.positions);
        geometry.fill(device, RTCBufferType::VERTEX, RTCFormat::FLOAT3, positions)?;
        geometry.fill(device, RTCBufferType::INDEX, RTCFormat::UINT3, &mesh.triangles)?;
        // SAFETY: the geometry is alive and complete.
        unsafe { sys::rtcCommitGeometry(geometry.0) };
        Ok(geometry)
    }

    fn instance(device: &Device, tree: &Tree, object_to_world: Affine3A) -> Result<Geometry, Error> {
        let geometry = Geometry::new(device, RTCGeometryType::INSTANCE)?;
        let columns = object_to_world.to_cols_array();
        // SAFETY: geometry and tree are alive, the tree is committed, and the matrix is four columns of three, as the format
        // says; Embree copies it.
        unsafe {
            sys::rtcSetGeometryInstancedScene(geometry.0, tree.0);
            let matrix = columns.as_ptr().cast::<c_void>();
            sys::rtcSetGeometryTransform(geometry.0, 0, RTCFormat::FLOAT3X4_COLUMN_MAJOR, matrix);
            sys::rtcCommitGeometry(geometry.0);
        }
        Ok(geometry)
    }

    /// Copies items into a buffer of Embree's, which is padded as its vector loads need.
    fn fill<T: bytemuck::Pod>(
        &self,
        device: &Device,
        buffer: RTCBufferType,
        format: RTCFormat,
        items: &[[T; 3]],
    ) -> Result<(), Error> {
        // SAFETY: the geometry is alive; stride and count are those of `items`.
        let memory =
            unsafe { sys::rtcSetNewGeometryBuffer(self.0, buffer, 0, format, size_of::<[T; 3]>(), items.len()) };
        if memory.is_null() {
            device.check("allocating a mesh")?;
            return Err(Error::Embree("cannot allocate a mesh".to_owned()));
        }
        // SAFETY: Embree allocated at least this many bytes, which nobody else uses yet.
        unsafe { ptr::copy_nonoverlapping(items.as_ptr().cast::<u8>(), memory.cast::<u8>(), size_of_val(items)) };
        Ok(())
    }
}

impl Drop for Geometry {
    fn drop(&mut self) {
        // SAFETY: it is released once.
        unsafe { sys::rtcReleaseGeometry(self.0) };
    }
}
