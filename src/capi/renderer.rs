//! Renderers that record into a host's command buffers.

use std::sync::Arc;

use super::call::{Failure, NeubrdfResult, call, end, hand_over, object, put, read, shared, sized_structs, write};
use super::context::NeubrdfContext;
use super::scene::NeubrdfScene;
use super::vulkan::*;
use crate::gpu::{Commands, Device, HostBuffer, HostImage, HostMesh};
use crate::image::Crop;
use crate::plugin::{Channel, Frame, Options, PixelFormat, Place, Renderer, Target};
use crate::render::{Family, Features, Sampler, Settings, Traversal};

/// A progressive render of one scene.
pub struct NeubrdfRenderer {
    device: Arc<Device>,
    pub(super) renderer: Renderer,
    /// Meshes from the host's buffers, by their index.
    pub(super) host_meshes: Vec<(u32, HostMesh)>,
    /// Those of the frame that was recorded last; kept so that the next one asks the heap for nothing.
    targets: Vec<Target>,
}

/// How rays find triangles.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NeubrdfTraversal {
    /// What suits the device.
    Auto = 0,
    /// VK_KHR_ray_query.
    RayQuery = 1,
    /// A BVH in a compute shader.
    Bvh = 2,
}

/// Where random numbers come from.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NeubrdfSampler {
    /// Owen-scrambled Sobol': less noise.
    Sobol = 0,
    /// Independent numbers, for statistics.
    Pcg = 1,
}

/// Bits of `NeubrdfOptions.reserve`: what the scene does not have yet and a change may bring.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NeubrdfReserve {
    /// Materials that emit.
    Emitters = 1,
    /// A sky; or, where there is an even one, one that is much brighter here than there.
    Environment = 2,
    /// A sun.
    Sun = 4,
    /// A lens.
    Lens = 8,
    /// Instances that move, in a scene of one that stands still.
    Instances = 16,
    /// Textured materials.
    Textures = 32,
    /// NeuBRDFs that vary over a texture.
    Footprints = 64,
    /// Materials that let rays through.
    Holes = 128,
    /// Diffuse materials.
    Diffuse = 256,
    /// Conductors.
    Conductor = 512,
    /// Dielectrics.
    Dielectric = 1024,
    /// Coated materials.
    Coated = 2048,
    /// NBRDF networks.
    Nbrdf = 4096,
    /// NeuBRDFs, no larger than the largest that the scene has a material of, on a mesh or not.
    Neubrdf = 8192,
    /// Layered materials.
    Layered = 16384,
    /// Woven materials.
    Woven = 32768,
    /// MERL's measurements.
    Merl = 65536,
    /// RGL's measurements.
    Rgl = 131072,
    /// Sparse samples.
    Sparse = 262144,
    /// Maps of normals.
    NormalMaps = 524288,
    /// Materials with a map of their roughness.
    RoughnessMaps = 1048576,
    /// Materials with a texture of what they emit.
    EmissionMaps = 2097152,
    /// Materials with patches of another one.
    Patches = 4194304,
    /// More emissive triangles than two, of which a tree picks the samples. Without it they are picked by power however many there come to be.
    LightTree = 8388608,
    /// Maps of the direction of anisotropy.
    AnisotropyDirectionMaps = 16777216,
}

impl NeubrdfReserve {
    const LAST: NeubrdfReserve = NeubrdfReserve::AnisotropyDirectionMaps;
}

/// What a host may choose; all of it may be 0.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct NeubrdfOptions {
    /// sizeof(NeubrdfOptions).
    pub size: u32,
    /// Path segments: 1 sees emission only, 2 adds direct light. 0 is 16.
    pub max_depth: u32,
    /// Picks the random numbers.
    pub seed: u32,
    /// A NeubrdfSampler.
    pub sampler: u32,
    /// A NeubrdfTraversal.
    pub traversal: u32,
    /// Paths in flight, which bound the memory, 100 to 200 bytes each, 128 more where paths are shared; 0 takes what suits the device.
    pub pool_paths: u32,
    /// Recordings that may be pending at once; 0 is 3.
    pub frames_in_flight: u32,
    /// Not 0 if albedo, normal and depth are wanted as targets.
    pub features: u32,
    /// Bits of NeubrdfReserve.
    pub reserve: u32,
    /// The part of the film to render, as x, y, width, height; a width of 0 is all of it.
    pub crop: [u32; 4],
    /// NeuBRDFs that there may be, if those are more than the scene has.
    pub neubrdf_count: u32,
    /// What a path may bring of indirect light, in any channel; 0 is no limit. It ends fireflies and takes light away.
    pub clamp_indirect: f32,
    /// Not 0 if neighbouring pixels shall share paths between diffuse surfaces: less noise of indirect light, at a price. Not for scenes with holes.
    pub path_reuse: u32,
}

/// How pixels are written. Rows run from the top, without gaps.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NeubrdfFormat {
    /// Linear, for VK_FORMAT_R32G32B32A32_SFLOAT.
    Rgba32Float = 0,
    /// Linear, for VK_FORMAT_R16G16B16A16_SFLOAT.
    Rgba16Float = 1,
    /// Tone-mapped and sRGB-encoded, for VK_FORMAT_R8G8B8A8_UNORM and _SRGB.
    Rgba8 = 2,
    /// The same, blue first.
    Bgra8 = 3,
}

/// What is written. All but the first need `NeubrdfOptions.features`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NeubrdfChannel {
    /// Mean radiance so far.
    Beauty = 0,
    /// Mean albedo of what is seen first.
    Albedo = 1,
    /// Mean shading normal of what is seen first, world space.
    Normal = 2,
    /// Distance along the camera's axis; infinite where nothing is.
    Depth = 3,
}

/// A host's image or buffer that a frame is written to; the one that is not VK_NULL_HANDLE. Both need the usage TRANSFER_DST.
/// On entry what the host did to them is done for the stage TRANSFER; on exit they are written in the stage TRANSFER.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct NeubrdfTarget {
    /// sizeof(NeubrdfTarget).
    pub size: u32,
    /// A NeubrdfFormat.
    pub format: u32,
    /// A NeubrdfChannel.
    pub channel: u32,
    /// 8-bit formats show radiance · 2^exposure.
    pub exposure: f32,
    /// Two-dimensional, one sample a texel, of a colour format whose texels are as many bytes as the format's.
    pub image: VkImage,
    /// Its layout before; VK_IMAGE_LAYOUT_UNDEFINED drops its texels.
    pub layout_before: VkImageLayout,
    /// Its layout afterwards; with UNDEFINED for both, it is taken to be in TRANSFER_DST_OPTIMAL and stays in it.
    pub layout_after: VkImageLayout,
    /// Where in it the picture's upper left pixel goes.
    pub origin: [u32; 2],
    /// A buffer instead.
    pub buffer: VkBuffer,
    /// Where in it the picture begins, in bytes.
    pub buffer_offset: u64,
    /// How many bytes there are for it.
    pub buffer_bytes: u64,
    /// Texels of the image across and down, so that one that is too small for the film is an error; 0 for both if it is large enough for certain.
    pub image_size: [u32; 2],
}

/// What a frame is to do.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct NeubrdfFrame {
    /// sizeof(NeubrdfFrame).
    pub size: u32,
    /// More samples of every pixel; 0 only writes the picture so far.
    pub samples: u32,
    /// Where the picture goes.
    pub targets: *const NeubrdfTarget,
    /// How many there are.
    pub target_count: u32,
    /// Not 0 if the estimated error is wanted.
    pub estimates_error: u32,
}

/// How a render stood after a frame.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct NeubrdfStatus {
    /// sizeof(NeubrdfStatus).
    pub size: u32,
    /// Samples a pixel that are in the frame's picture; 0 if the number was no frame's, or a later frame has taken its place.
    pub samples: u32,
    /// The estimated relative error of that picture; below 0 where there is none, as before the fourth sample.
    pub error: f64,
    /// Samples so far that were not finite; they count as black.
    pub rejected: u32,
    /// Nothing.
    pub reserved: u32,
}

sized_structs! {
    NeubrdfOptions: 52 {
        size, max_depth, seed, sampler, traversal, pool_paths, frames_in_flight, features, reserve, crop, neubrdf_count, clamp_indirect,
        path_reuse,
    }
    NeubrdfTarget: 64 {
        size, format, channel, exposure, image, layout_before, layout_after, origin, buffer, buffer_offset, buffer_bytes, image_size,
    }
    NeubrdfFrame: 24 { size, samples, targets, target_count, estimates_error }
    NeubrdfStatus: 24 { size, samples, error, rejected, reserved }
}

impl NeubrdfOptions {
    fn options(&self) -> Result<Options, Failure> {
        let sampler = match self.sampler {
            0 => Sampler::Sobol,
            1 => Sampler::Pcg,
            other => return Err(Failure::argument(format!("NeubrdfOptions.sampler is {other}: no NeubrdfSampler"))),
        };
        let traversal = match self.traversal {
            0 => None,
            1 => Some(Traversal::RayQuery),
            2 => Some(Traversal::Bvh),
            other => {
                return Err(Failure::argument(format!("NeubrdfOptions.traversal is {other}: no NeubrdfTraversal")));
            }
        };
        let [x, y, width, height] = self.crop;
        let default = Options::default();
        let or = |number: u32, default: u32| if number == 0 { default } else { number };
        Ok(Options {
            settings: Settings {
                max_depth: or(self.max_depth, default.settings.max_depth),
                clamp_indirect: (self.clamp_indirect != 0.0).then_some(self.clamp_indirect),
                path_reuse: self.path_reuse != 0,
                seed: self.seed,
                sampler,
                crop: (width > 0).then_some(Crop { x, y, width, height }),
                features: self.features != 0,
                ..default.settings
            },
            traversal,
            pool_paths: (self.pool_paths > 0).then_some(self.pool_paths),
            frames_in_flight: or(self.frames_in_flight, default.frames_in_flight),
            reserve: self.reserved()?,
        })
    }

    fn reserved(&self) -> Result<Features, Failure> {
        let families = [
            (NeubrdfReserve::Diffuse, Family::Diffuse),
            (NeubrdfReserve::Conductor, Family::Conductor),
            (NeubrdfReserve::Dielectric, Family::Dielectric),
            (NeubrdfReserve::Coated, Family::Coated),
            (NeubrdfReserve::Nbrdf, Family::Nbrdf),
            (NeubrdfReserve::Neubrdf, Family::NeuBrdf),
            (NeubrdfReserve::Layered, Family::Layered),
            (NeubrdfReserve::Woven, Family::Woven),
            (NeubrdfReserve::Merl, Family::Merl),
            (NeubrdfReserve::Rgl, Family::Rgl),
            (NeubrdfReserve::Sparse, Family::Sparse),
        ];
        let has = |bit: NeubrdfReserve| self.reserve & bit as u32 != 0;
        let all = 2 * NeubrdfReserve::LAST as u32 - 1;
        if self.reserve & !all != 0 {
            return Err(Failure::argument(format!(
                "NeubrdfOptions.reserve is {:#x}: bits of NeubrdfReserve",
                self.reserve
            )));
        }
        let mask = families.iter().filter(|(bit, _)| has(*bit)).fold(0, |mask, (_, family)| mask | 1 << *family as u32);
        Ok(Features {
            families: mask,
            emitters: has(NeubrdfReserve::Emitters),
            light_tree: has(NeubrdfReserve::LightTree),
            environment: has(NeubrdfReserve::Environment),
            uneven_sky: has(NeubrdfReserve::Environment),
            sun: has(NeubrdfReserve::Sun),
            lens: has(NeubrdfReserve::Lens),
            instanced: has(NeubrdfReserve::Instances),
            textures: has(NeubrdfReserve::Textures),
            footprints: has(NeubrdfReserve::Footprints),
            holes: has(NeubrdfReserve::Holes),
            normal_maps: has(NeubrdfReserve::NormalMaps),
            roughness_maps: has(NeubrdfReserve::RoughnessMaps),
            emission_maps: has(NeubrdfReserve::EmissionMaps),
            anisotropy_direction_maps: has(NeubrdfReserve::AnisotropyDirectionMaps),
            patches: has(NeubrdfReserve::Patches),
            neubrdf_queues: self.neubrdf_count.clamp(1, Features::MOST_NEUBRDF_QUEUES),
        })
    }
}

impl NeubrdfTarget {
    /// # Safety
    /// The image or buffer is as the struct says, and lives until the commands that write it are done.
    unsafe fn target(&self) -> Result<Target, Failure> {
        let format = match self.format {
            0 => PixelFormat::Rgba32Float,
            1 => PixelFormat::Rgba16Float,
            2 => PixelFormat::Rgba8,
            3 => PixelFormat::Bgra8,
            other => return Err(Failure::argument(format!("NeubrdfTarget.format is {other}: no NeubrdfFormat"))),
        };
        let channel = match self.channel {
            0 => Channel::Beauty,
            1 => Channel::Albedo,
            2 => Channel::Normal,
            3 => Channel::Depth,
            other => return Err(Failure::argument(format!("NeubrdfTarget.channel is {other}: no NeubrdfChannel"))),
        };
        let place = match (self.image != VkImage::null(), self.buffer != VkBuffer::null()) {
            (true, false) => {
                let size = if self.image_size == [0, 0] { [u32::MAX; 2] } else { self.image_size };
                // SAFETY: as the caller says.
                let image = unsafe { HostImage::new(self.image, size) }.with_origin(self.origin);
                let none = VkImageLayout::UNDEFINED;
                Place::Image(match (self.layout_before, self.layout_after) {
                    (before, after) if before == none && after == none => image,
                    (_, after) if after == none => {
                        return Err(Failure::argument("NeubrdfTarget.layout_after is VK_IMAGE_LAYOUT_UNDEFINED"));
                    }
                    (before, after) => image.with_layouts(before, after),
                })
            }
            (false, true) => {
                // SAFETY: as the caller says.
                Place::Buffer(unsafe { HostBuffer::new(self.buffer, self.buffer_offset, self.buffer_bytes) })
            }
            _ => return Err(Failure::argument("a NeubrdfTarget has an image or a buffer, one of the two")),
        };
        Ok(Target { place, format, channel, exposure: self.exposure })
    }
}

/// Makes a renderer: trees and tables on the CPU, kernels, memory. Nothing is submitted. It takes as long as the driver compiles, and may
/// be called on any thread. `options` may be null.
///
/// # Safety
/// The objects are alive; `renderer` points to room for a pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_renderer_create(
    context: *const NeubrdfContext,
    scene: *const NeubrdfScene,
    options: *const NeubrdfOptions,
    renderer: *mut *mut NeubrdfRenderer,
) -> NeubrdfResult {
    call(|| {
        // SAFETY: as the caller says.
        let (context, scene) = unsafe { (shared(context, "context")?, shared(scene, "scene")?) };
        let options = match options.is_null() {
            true => Options::default(),
            // SAFETY: as the caller says.
            false => unsafe { read(options)? }.options()?,
        };
        let (device, host_meshes) = (context.device.clone(), scene.host_meshes.clone());
        let made = Renderer::with_host_meshes(&device, scene.scene.clone(), &host_meshes, &options)?;
        // SAFETY: as the caller says.
        unsafe { hand_over(renderer, NeubrdfRenderer { device, renderer: made, host_meshes, targets: Vec::new() }) }
    })
}

/// Ends the renderer. All that it recorded is done by then.
///
/// # Safety
/// The object is alive, or null, and the device works on none of its recordings.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_renderer_destroy(renderer: *mut NeubrdfRenderer) {
    // SAFETY: as the caller says.
    unsafe { end(renderer) }
}

/// A copy of the scene as it is now, with all changes, for a new renderer where NEUBRDF_RESULT_NEW_RENDERER says that it takes one: the call of
/// `neubrdf_scene_` that is named as the one that was refused changes the copy. The caller ends it. It has no warnings. A sky or a sun
/// that was reserved and is not there is a black one.
///
/// A mesh that came from the host's buffers does so again: the new renderer's first recording reads them, the vertices from where a deformation
/// read them last, and then they must still be there. If a deformation gave them on the CPU, the mesh is in the scene whole: with the texture coordinates
/// that its arrays had.
///
/// # Safety
/// The object is alive; `scene` points to room for a pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_renderer_scene(
    renderer: *const NeubrdfRenderer,
    scene: *mut *mut NeubrdfScene,
) -> NeubrdfResult {
    call(|| {
        // SAFETY: as the caller says.
        let NeubrdfRenderer { renderer, host_meshes, .. } = unsafe { shared(renderer, "renderer")? };
        let copy = NeubrdfScene::new(renderer.scene().clone(), host_meshes.clone());
        // SAFETY: as the caller says.
        unsafe { hand_over(scene, copy) }
    })
}

/// Pixels across and down: what a target must have room for. Samples a pixel that the recordings so far take.
///
/// # Safety
/// The object is alive; each of the others is null or points to room for a number.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_renderer_size(
    renderer: *mut NeubrdfRenderer,
    width: *mut u32,
    height: *mut u32,
    samples: *mut u32,
) -> NeubrdfResult {
    call(|| {
        // SAFETY: as the caller says.
        unsafe {
            let renderer = &object(renderer, "renderer")?.renderer;
            let [columns, rows] = renderer.size();
            put(width, columns);
            put(height, rows);
            put(samples, renderer.samples());
        }
        Ok(())
    })
}

/// Records what the next frame would otherwise upload first. Counts as a frame in flight. `ticket`, if not null, is told its number.
///
/// # Safety
/// As of `neubrdf_renderer_record`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_renderer_record_upload(
    renderer: *mut NeubrdfRenderer,
    command_buffer: VkCommandBuffer,
    ticket: *mut u64,
) -> NeubrdfResult {
    call(|| {
        // SAFETY: as the caller says.
        unsafe {
            let NeubrdfRenderer { device, renderer, .. } = object(renderer, "renderer")?;
            let mut commands = Commands::wrap(device, command_buffer);
            let number = renderer.record_upload(&mut commands)?;
            commands.finish()?;
            put(ticket, number);
        }
        Ok(())
    })
}

/// Records a frame: what changed, more samples, and the picture's way to the targets. Nothing is submitted, waited for or allocated on the
/// device. `ticket`, if not null, is told the recording's number. Command buffers are submitted once each, in the order of the recordings,
/// on queues that keep that order. After an error the command buffer must not be submitted.
///
/// # Safety
/// The command buffer is of the context's device, in the recording state, outside a render pass, on a queue that computes. Targets live until
/// it is done. What was bound for compute before is bound no more.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_renderer_record(
    renderer: *mut NeubrdfRenderer,
    command_buffer: VkCommandBuffer,
    frame: *const NeubrdfFrame,
    ticket: *mut u64,
) -> NeubrdfResult {
    call(|| {
        // SAFETY: as the caller says.
        unsafe {
            let NeubrdfRenderer { device, renderer, targets, .. } = object(renderer, "renderer")?;
            let frame = read(frame)?;
            fill_targets(targets, &frame)?;
            let mut commands = Commands::wrap(device, command_buffer);
            let frame = Frame { samples: frame.samples, targets, estimates_error: frame.estimates_error != 0 };
            let number = renderer.record(&mut commands, &frame)?;
            commands.finish()?;
            put(ticket, number);
        }
        Ok(())
    })
}

/// Makes the list that of a frame's targets, which stand as far apart as the first one's size says: all have that size.
///
/// # Safety
/// As of [`neubrdf_renderer_record`].
unsafe fn fill_targets(targets: &mut Vec<Target>, frame: &NeubrdfFrame) -> Result<(), Failure> {
    targets.clear();
    let mut stride = None;
    for index in 0..frame.target_count {
        // SAFETY: as the caller says.
        let target = unsafe { read(frame.targets.byte_add(index as usize * stride.unwrap_or(0) as usize))? };
        let stride = *stride.get_or_insert(target.size);
        if target.size != stride {
            let found =
                format!("NeubrdfFrame.targets[{index}].size is {}, and that of the first {stride}", target.size);
            return Err(Failure::argument(format!("{found}: set both to sizeof(NeubrdfTarget)")));
        }
        // SAFETY: as the caller says.
        targets.push(unsafe { target.target()? });
    }
    Ok(())
}

/// The host knows that the recording of that number and all before it are done: gives back what they alone used. `status`, if not null, is
/// told what the frame left. It never waits.
///
/// # Safety
/// The object is alive, and the device is done with these recordings.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_renderer_complete(
    renderer: *mut NeubrdfRenderer,
    ticket: u64,
    status: *mut NeubrdfStatus,
) -> NeubrdfResult {
    call(|| {
        // SAFETY: as the caller says.
        let found = unsafe { object(renderer, "renderer")? }.renderer.complete(ticket);
        if status.is_null() {
            return Ok(());
        }
        let told = NeubrdfStatus {
            size: 0,
            samples: found.map_or(0, |found| found.samples),
            error: found.and_then(|found| found.error).unwrap_or(-1.0),
            rejected: found.map_or(0, |found| found.rejected),
            reserved: 0,
        };
        // SAFETY: as the caller says.
        unsafe { write(status, told) }
    })
}

/// The recording of that number and all after it will never be submitted: the next one uploads what they were to, goes on from the samples that
/// were taken before them, and has that number. Meshes in the host's buffers that they were to read, the next one reads. NEUBRDF_RESULT_INVALID_ARGUMENT if no recording of that number is in flight.
///
/// # Safety
/// The object is alive, and these recordings were not submitted.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_renderer_abandon(renderer: *mut NeubrdfRenderer, ticket: u64) -> NeubrdfResult {
    call(|| {
        // SAFETY: as the caller says.
        unsafe { object(renderer, "renderer")? }.renderer.abandon(ticket)?;
        Ok(())
    })
}

/// For a host whose own call returned VK_ERROR_DEVICE_LOST: returns NEUBRDF_RESULT_DEVICE_LOST, and `neubrdf_last_error` says how far the oldest
/// recording came that is not known to be done.
///
/// # Safety
/// The object is alive.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_renderer_device_lost(renderer: *mut NeubrdfRenderer) -> NeubrdfResult {
    // SAFETY: as the caller says.
    call(|| Err(unsafe { object(renderer, "renderer")? }.renderer.device_lost().into()))
}

/// The next frame begins with a black film.
///
/// # Safety
/// The object is alive.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_renderer_reset(renderer: *mut NeubrdfRenderer) -> NeubrdfResult {
    call(|| {
        // SAFETY: as the caller says.
        unsafe { object(renderer, "renderer")? }.renderer.reset();
        Ok(())
    })
}

/// Gives the film another size, as of a window, and begins anew.
///
/// # Safety
/// The object is alive.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_renderer_resize(
    renderer: *mut NeubrdfRenderer,
    width: u32,
    height: u32,
) -> NeubrdfResult {
    // SAFETY: as the caller says.
    call(|| Ok(unsafe { object(renderer, "renderer")? }.renderer.resize(width, height)?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use ash::vk::Handle;

    /// Of a program that was built with a newer header.
    #[repr(C)]
    struct Newer {
        target: NeubrdfTarget,
        more: u64,
    }

    #[test]
    fn targets_stand_as_far_apart_as_the_first_one_s_size_says_and_take_no_more_of_the_heap_than_the_first_ones() {
        let mut targets = Vec::new();
        let mut read = |sizes: [usize; 2]| {
            let newer = [(sizes[0], 1), (sizes[1], 3)].map(|(size, format)| {
                let target = NeubrdfTarget {
                    size: size as u32,
                    format,
                    channel: 0,
                    exposure: 0.0,
                    image: VkImage::null(),
                    layout_before: VkImageLayout::UNDEFINED,
                    layout_after: VkImageLayout::UNDEFINED,
                    origin: [0; 2],
                    buffer: VkBuffer::from_raw(1),
                    buffer_offset: 0,
                    buffer_bytes: 0,
                    image_size: [0; 2],
                };
                Newer { target, more: 0 }
            });
            let frame = NeubrdfFrame {
                size: size_of::<NeubrdfFrame>() as u32,
                samples: 1,
                targets: newer.as_ptr().cast(),
                target_count: 2,
                estimates_error: 0,
            };
            // SAFETY: two targets are there, of the first one's size; the buffer is not looked at.
            unsafe { fill_targets(&mut targets, &frame) }.ok()?;
            let formats: Vec<PixelFormat> = targets.iter().map(|target| target.format).collect();
            Some((formats, targets.as_ptr()))
        };
        let size = size_of::<Newer>();
        let first = read([size, size]).unwrap();
        assert_eq!(first.0, [PixelFormat::Rgba16Float, PixelFormat::Bgra8]);
        assert_eq!(read([size, size_of::<NeubrdfTarget>()]), None);
        assert_eq!(read([size, size]), Some(first));
    }

    #[test]
    fn whatever_has_a_bit_can_be_reserved() {
        let reserved = |reserve| {
            let choices = NeubrdfOptions {
                size: size_of::<NeubrdfOptions>() as u32,
                max_depth: 0,
                seed: 0,
                sampler: 0,
                traversal: 0,
                pool_paths: 0,
                frames_in_flight: 0,
                features: 0,
                reserve,
                crop: [0; 4],
                neubrdf_count: 0,
                clamp_indirect: 0.0,
                path_reuse: 0,
            };
            choices.reserved()
        };
        let last = (NeubrdfReserve::LAST as u32).ilog2();
        for bit in 0..=last {
            assert_ne!(reserved(1 << bit).ok().unwrap(), Features::NONE, "bit {bit}");
        }
        assert_eq!(reserved(0).ok().unwrap(), Features::NONE);
        assert!(reserved(1 << (last + 1)).is_err());
    }
}
