/* neubrdf: path-traced neural BRDFs in your own Vulkan device. Made by cbindgen from src/capi: do not edit.

   Every call returns a NeubrdfResult; neubrdf_last_error says more. An object is used by one thread at a time.
   Structs begin with their size: set it, and let all that you do not know of be 0.
   docs/embedding.md is the page to begin with. */

#ifndef NEUBRDF_H
#define NEUBRDF_H

#include <stdint.h>
#include <vulkan/vulkan_core.h>

/**
 * What became of a call. `neubrdf_last_error` has the words for all but NEUBRDF_RESULT_OK.
 */
typedef enum NeubrdfResult {
  /**
   * It did what it says.
   */
  NEUBRDF_RESULT_OK = 0,
  /**
   * A pointer is null, or a number is none that the call takes.
   */
  NEUBRDF_RESULT_INVALID_ARGUMENT = 1,
  /**
   * A scene, or a file of one, is not as it must be.
   */
  NEUBRDF_RESULT_SCENE = 2,
  /**
   * Settings are out of range, or the device lacks what they need.
   */
  NEUBRDF_RESULT_SETTINGS = 3,
  /**
   * The device lacks what we need of every device.
   */
  NEUBRDF_RESULT_UNFIT_DEVICE = 4,
  /**
   * No memory is left. All objects are as before the call.
   */
  NEUBRDF_RESULT_OUT_OF_MEMORY = 5,
  /**
   * The device is lost.
   */
  NEUBRDF_RESULT_DEVICE_LOST = 6,
  /**
   * Another Vulkan call failed.
   */
  NEUBRDF_RESULT_VULKAN = 7,
  /**
   * The change needs kernels that were not built: make a new renderer, or reserve for it beforehand.
   */
  NEUBRDF_RESULT_NEW_RENDERER = 8,
  /**
   * As many recordings as the renderer was made for are not known to be done.
   */
  NEUBRDF_RESULT_FRAMES_IN_FLIGHT = 9,
  /**
   * A mistake of this library: please report it. Destroy the objects that the call was given.
   */
  NEUBRDF_RESULT_PANIC = 10,
} NeubrdfResult;

/**
 * How a surface scatters. Roughness is GGX's α.
 */
typedef enum NeubrdfSurface {
  /**
   * Lambertian, of albedo `color`.
   */
  NEUBRDF_SURFACE_DIFFUSE = 0,
  /**
   * A metal: by Schlick from `color` at normal incidence, or by the complex index `eta` + i `kappa` where `eta` is not 0.
   */
  NEUBRDF_SURFACE_CONDUCTOR = 1,
  /**
   * Glass of index `ior`.
   */
  NEUBRDF_SURFACE_DIELECTRIC = 2,
  /**
   * Diffuse of albedo `color` under a coat of index `ior`.
   */
  NEUBRDF_SURFACE_COATED = 3,
  /**
   * That of the material `surface_of`, of a file for example, with the emission, the opacity, the maps and the patches that are said here.
   */
  NEUBRDF_SURFACE_OF_MATERIAL = 4,
} NeubrdfSurface;

/**
 * How rays find triangles.
 */
typedef enum NeubrdfTraversal {
  /**
   * What suits the device.
   */
  NEUBRDF_TRAVERSAL_AUTO = 0,
  /**
   * VK_KHR_ray_query.
   */
  NEUBRDF_TRAVERSAL_RAY_QUERY = 1,
  /**
   * A BVH in a compute shader.
   */
  NEUBRDF_TRAVERSAL_BVH = 2,
} NeubrdfTraversal;

/**
 * Where random numbers come from.
 */
typedef enum NeubrdfSampler {
  /**
   * Owen-scrambled Sobol': less noise.
   */
  NEUBRDF_SAMPLER_SOBOL = 0,
  /**
   * Independent numbers, for statistics.
   */
  NEUBRDF_SAMPLER_PCG = 1,
} NeubrdfSampler;

/**
 * Bits of `NeubrdfOptions.reserve`: what the scene does not have yet and a change may bring.
 */
typedef enum NeubrdfReserve {
  /**
   * Materials that emit.
   */
  NEUBRDF_RESERVE_EMITTERS = 1,
  /**
   * A sky; or, where there is an even one, one that is much brighter here than there.
   */
  NEUBRDF_RESERVE_ENVIRONMENT = 2,
  /**
   * A sun.
   */
  NEUBRDF_RESERVE_SUN = 4,
  /**
   * A lens.
   */
  NEUBRDF_RESERVE_LENS = 8,
  /**
   * Instances that move, in a scene of one that stands still.
   */
  NEUBRDF_RESERVE_INSTANCES = 16,
  /**
   * Textured materials.
   */
  NEUBRDF_RESERVE_TEXTURES = 32,
  /**
   * NeuBRDFs that vary over a texture.
   */
  NEUBRDF_RESERVE_FOOTPRINTS = 64,
  /**
   * Materials that let rays through.
   */
  NEUBRDF_RESERVE_HOLES = 128,
  /**
   * Diffuse materials.
   */
  NEUBRDF_RESERVE_DIFFUSE = 256,
  /**
   * Conductors.
   */
  NEUBRDF_RESERVE_CONDUCTOR = 512,
  /**
   * Dielectrics.
   */
  NEUBRDF_RESERVE_DIELECTRIC = 1024,
  /**
   * Coated materials.
   */
  NEUBRDF_RESERVE_COATED = 2048,
  /**
   * NBRDF networks.
   */
  NEUBRDF_RESERVE_NBRDF = 4096,
  /**
   * NeuBRDFs, no larger than the largest that the scene has a material of, on a mesh or not.
   */
  NEUBRDF_RESERVE_NEUBRDF = 8192,
  /**
   * Layered materials.
   */
  NEUBRDF_RESERVE_LAYERED = 16384,
  /**
   * Woven materials.
   */
  NEUBRDF_RESERVE_WOVEN = 32768,
  /**
   * MERL's measurements.
   */
  NEUBRDF_RESERVE_MERL = 65536,
  /**
   * RGL's measurements.
   */
  NEUBRDF_RESERVE_RGL = 131072,
  /**
   * Sparse samples.
   */
  NEUBRDF_RESERVE_SPARSE = 262144,
  /**
   * Maps of normals.
   */
  NEUBRDF_RESERVE_NORMAL_MAPS = 524288,
  /**
   * Materials with a map of their roughness.
   */
  NEUBRDF_RESERVE_ROUGHNESS_MAPS = 1048576,
  /**
   * Materials with a texture of what they emit.
   */
  NEUBRDF_RESERVE_EMISSION_MAPS = 2097152,
  /**
   * Materials with patches of another one.
   */
  NEUBRDF_RESERVE_PATCHES = 4194304,
  /**
   * More emissive triangles than two, of which a tree picks the samples. Without it they are picked by power however many there come to be.
   */
  NEUBRDF_RESERVE_LIGHT_TREE = 8388608,
  /**
   * Maps of the direction of anisotropy.
   */
  NEUBRDF_RESERVE_ANISOTROPY_DIRECTION_MAPS = 16777216,
} NeubrdfReserve;

/**
 * How pixels are written. Rows run from the top, without gaps.
 */
typedef enum NeubrdfFormat {
  /**
   * Linear, for VK_FORMAT_R32G32B32A32_SFLOAT.
   */
  NEUBRDF_FORMAT_RGBA32_FLOAT = 0,
  /**
   * Linear, for VK_FORMAT_R16G16B16A16_SFLOAT.
   */
  NEUBRDF_FORMAT_RGBA16_FLOAT = 1,
  /**
   * Tone-mapped and sRGB-encoded, for VK_FORMAT_R8G8B8A8_UNORM and _SRGB.
   */
  NEUBRDF_FORMAT_RGBA8 = 2,
  /**
   * The same, blue first.
   */
  NEUBRDF_FORMAT_BGRA8 = 3,
} NeubrdfFormat;

/**
 * What is written. All but the first need `NeubrdfOptions.features`.
 */
typedef enum NeubrdfChannel {
  /**
   * Mean radiance so far.
   */
  NEUBRDF_CHANNEL_BEAUTY = 0,
  /**
   * Mean albedo of what is seen first.
   */
  NEUBRDF_CHANNEL_ALBEDO = 1,
  /**
   * Mean shading normal of what is seen first, world space.
   */
  NEUBRDF_CHANNEL_NORMAL = 2,
  /**
   * Distance along the camera's axis; infinite where nothing is.
   */
  NEUBRDF_CHANNEL_DEPTH = 3,
} NeubrdfChannel;

/**
 * How a structure over triangles or instances follows what moved.
 */
typedef enum NeubrdfUpdate {
  /**
   * It is built anew.
   */
  NEUBRDF_UPDATE_REBUILD = 0,
  /**
   * Its boxes are fitted anew: faster, but rays take the longer, the farther things moved since the last rebuild. The first refit is a
   * rebuild, of something that can be refitted.
   */
  NEUBRDF_UPDATE_REFIT = 1,
} NeubrdfUpdate;

/**
 * What memory is for.
 */
typedef enum NeubrdfMemoryUse {
  /**
   * The device reads and writes it.
   */
  NEUBRDF_MEMORY_USE_DEVICE = 0,
  /**
   * The CPU writes, the device reads: mapped, coherent.
   */
  NEUBRDF_MEMORY_USE_UPLOAD = 1,
  /**
   * The device writes, the CPU reads: mapped, coherent, better cached.
   */
  NEUBRDF_MEMORY_USE_READBACK = 2,
} NeubrdfMemoryUse;

/**
 * A device lent to us.
 */
typedef struct NeubrdfContext NeubrdfContext;

/**
 * A progressive render of one scene.
 */
typedef struct NeubrdfRenderer NeubrdfRenderer;

/**
 * What a physical device is to be opened with.
 */
typedef struct NeubrdfRequirements NeubrdfRequirements;

/**
 * What is rendered. Renderers take a copy.
 */
typedef struct NeubrdfScene NeubrdfScene;

/**
 * Memory that a buffer asks for, from one VkDeviceMemory made with VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT.
 */
typedef struct NeubrdfMemoryRequest {
  /**
   * sizeof(NeubrdfMemoryRequest), as this library has it.
   */
  uint32_t size;
  /**
   * A NeubrdfMemoryUse.
   */
  uint32_t memory_use;
  /**
   * Bytes.
   */
  uint64_t bytes;
  /**
   * The offset is a multiple of it.
   */
  uint64_t alignment;
  /**
   * Bit i: memory type i will do.
   */
  uint32_t memory_type_bits;
  /**
   * Nothing.
   */
  uint32_t reserved;
  /**
   * What the buffer is called; valid during the call.
   */
  const char *name;
} NeubrdfMemoryRequest;

/**
 * A piece of the host's memory.
 */
typedef struct NeubrdfMemory {
  /**
   * What it is a piece of.
   */
  VkDeviceMemory memory;
  /**
   * Where it begins.
   */
  uint64_t offset;
  /**
   * Where the CPU sees it, from its beginning on; null where it does not.
   */
  void *mapped;
  /**
   * VkMemoryPropertyFlags of its type.
   */
  uint32_t properties;
  /**
   * Nothing.
   */
  uint32_t reserved;
  /**
   * The host's own.
   */
  void *handle;
} NeubrdfMemory;

/**
 * A host's device. Nothing of it is ever destroyed, submitted to or waited for.
 */
typedef struct NeubrdfHost {
  /**
   * sizeof(NeubrdfHost).
   */
  uint32_t size;
  /**
   * The family of the queue that the command buffers go to; it computes.
   */
  uint32_t queue_family;
  /**
   * The loader's.
   */
  PFN_vkGetInstanceProcAddr get_instance_proc_addr;
  /**
   * For Vulkan 1.2 or later.
   */
  VkInstance instance;
  /**
   * What the device is of.
   */
  VkPhysicalDevice physical_device;
  /**
   * Made with what the requirements say.
   */
  VkDevice device;
  /**
   * Keeps our pipelines; VK_NULL_HANDLE is a cache of our own, in memory.
   */
  VkPipelineCache pipeline_cache;
  /**
   * Not 0 if ray query is enabled on the device: what `neubrdf_requirements_has_ray_query` said when it was made.
   */
  uint32_t ray_query;
  /**
   * Not 0 if the instance has VK_EXT_debug_utils: our passes and objects then have names in captures.
   */
  uint32_t debug_utils;
  /**
   * Gives the memory of our buffers; null is an allocator of our own. Called from any thread that makes or ends objects, or changes a
   * renderer's scene, and from none in a frame. Returns 0 and fills `memory`, or anything else where no memory is left.
   */
  int32_t (*allocate)(void *user, const struct NeubrdfMemoryRequest *request, struct NeubrdfMemory *memory);
  /**
   * Takes it back: the buffer is gone. Called from those threads too, and from one in `neubrdf_renderer_complete`, which gives back what the
   * recordings that are done used alone.
   */
  void (*free)(void *user, const struct NeubrdfMemory *memory);
  /**
   * The host's own, for these two.
   */
  void *user;
} NeubrdfHost;

/**
 * A perspective camera, right-handed, y up if `up` says so.
 */
typedef struct NeubrdfCamera {
  /**
   * sizeof(NeubrdfCamera).
   */
  uint32_t size;
  /**
   * The whole vertical angle, degrees in (0, 180).
   */
  float vertical_fov_degrees;
  /**
   * Where it is.
   */
  float eye[3];
  /**
   * What it looks at.
   */
  float target[3];
  /**
   * Not along the view.
   */
  float up[3];
  /**
   * Radius of a thin lens; 0 is a pinhole.
   */
  float lens_radius;
  /**
   * Distance along the axis of what is sharp; only with a lens.
   */
  float focus_distance;
} NeubrdfCamera;

/**
 * A material of a closed form, or with the surface of another one. Those of files: `neubrdf_scene_add_material_file`.
 */
typedef struct NeubrdfMaterial {
  /**
   * sizeof(NeubrdfMaterial).
   */
  uint32_t size;
  /**
   * A NeubrdfSurface.
   */
  uint32_t surface;
  /**
   * Linear Rec. 709, each in [0, 1].
   */
  float color[3];
  /**
   * 1 + the index of a texture that `color` is multiplied by; 0 for none.
   */
  uint32_t texture;
  /**
   * Of a conductor.
   */
  float eta[3];
  /**
   * Of a conductor.
   */
  float kappa[3];
  /**
   * α along u and v, in [0, 1]; only conductors differ in them.
   */
  float alpha[2];
  /**
   * Index of refraction of a dielectric or a coat; 0 is 1.5.
   */
  float ior;
  /**
   * Radiance, W/(sr m²).
   */
  float emission[3];
  /**
   * Not 0 if the backs of triangles emit too.
   */
  uint32_t emits_both_sides;
  /**
   * The probability with which a ray goes on as if there were nothing, in [0, 1]; 0 of what emits.
   */
  float transparency;
  /**
   * 1 + the index of a texture that 1 - `transparency` is multiplied by, by its red; 0 for none.
   */
  uint32_t opacity_texture;
  /**
   * 1 + the index of a texture of shading normals: x along u, y along v, z along the triangle's own, each from -1 (0 in the texture) to 1;
   * 0 for none.
   */
  uint32_t normal_map;
  /**
   * 1 + the index of a texture of roughness, along u by its red and along v by its green, of which α is the square instead of `alpha`; where
   * there is but one α it is the mean of both; 0 for none. Not of the diffuse.
   */
  uint32_t roughness_map;
  /**
   * 1 + the index of a texture that `emission` is multiplied by; 0 for none.
   */
  uint32_t emission_texture;
  /**
   * 1 + the index of a texture; where its red is at least ½, the material `patch_material` stands instead, of which all counts but its opacity.
   * Neither emits. 0 for none.
   */
  uint32_t patch_map;
  /**
   * The index of a material without such patches.
   */
  uint32_t patch_material;
  /**
   * The index of the material whose surface it is, where `surface` says so.
   */
  uint32_t surface_of;
  /**
   * 1 + the index of a texture of the direction about the normal that "along u" turns into, by the angle ψ from u towards v: cos 2ψ in red and
   * sin 2ψ in green, of which what lies between texels can be told; 0 for none. Of conductors, and surfaces of files.
   */
  uint32_t anisotropy_direction_map;
} NeubrdfMaterial;

/**
 * Triangles in arrays that are copied.
 */
typedef struct NeubrdfMesh {
  /**
   * sizeof(NeubrdfMesh).
   */
  uint32_t size;
  /**
   * How many vertices there are.
   */
  uint32_t vertex_count;
  /**
   * x, y, z of each vertex.
   */
  const float *positions;
  /**
   * Unit normals, x, y, z of each vertex; null for a flat mesh.
   */
  const float *normals;
  /**
   * u, v of each vertex, v up; null for none.
   */
  const float *uvs;
  /**
   * Three vertices a triangle, counter-clockwise seen from the front.
   */
  const uint32_t *indices;
  /**
   * The material of each triangle; null if `material` is that of all.
   */
  const uint32_t *materials;
  /**
   * How many triangles there are.
   */
  uint32_t triangle_count;
  /**
   * The material of all triangles, where `materials` is null.
   */
  uint32_t material;
} NeubrdfMesh;

/**
 * Triangles that the host has on the device. Addresses are those of vkGetBufferDeviceAddress plus the offset of the first vertex or index,
 * from buffers made with VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT. The first recording of a renderer reads them, in the stage
 * COMPUTE_SHADER with SHADER_READ, and copies them on the device: what wrote them is done for that, and what writes them afterwards waits for it.
 */
typedef struct NeubrdfDeviceMesh {
  /**
   * sizeof(NeubrdfDeviceMesh).
   */
  uint32_t size;
  /**
   * How many vertices there are.
   */
  uint32_t vertex_count;
  /**
   * x, y, z of each vertex, f32.
   */
  VkDeviceAddress positions;
  /**
   * Unit normals, x, y, z of each vertex; 0 for a flat mesh.
   */
  VkDeviceAddress normals;
  /**
   * u, v of each vertex, v up; 0 for none.
   */
  VkDeviceAddress uvs;
  /**
   * Three vertices a triangle, counter-clockwise seen from the front. Words are read whole: of 16 bits the buffer has an even number.
   */
  VkDeviceAddress indices;
  /**
   * Bytes from a vertex's position to the next one's; 0 is 12.
   */
  uint32_t position_stride;
  /**
   * The same of normals; 0 is 12.
   */
  uint32_t normal_stride;
  /**
   * The same of texture coordinates; 0 is 8.
   */
  uint32_t uv_stride;
  /**
   * VK_INDEX_TYPE_UINT16 or VK_INDEX_TYPE_UINT32.
   */
  VkIndexType index_type;
  /**
   * How many triangles there are.
   */
  uint32_t triangle_count;
  /**
   * The material of all triangles, where `materials` is null.
   */
  uint32_t material;
  /**
   * The material of each triangle, in the CPU's memory, copied; null if `material` is that of all.
   */
  const uint32_t *materials;
  /**
   * Lower corner of a box around the vertices.
   */
  float lower[3];
  /**
   * Its upper corner.
   */
  float upper[3];
} NeubrdfDeviceMesh;

/**
 * What a host may choose; all of it may be 0.
 */
typedef struct NeubrdfOptions {
  /**
   * sizeof(NeubrdfOptions).
   */
  uint32_t size;
  /**
   * Path segments: 1 sees emission only, 2 adds direct light. 0 is 16.
   */
  uint32_t max_depth;
  /**
   * Picks the random numbers.
   */
  uint32_t seed;
  /**
   * A NeubrdfSampler.
   */
  uint32_t sampler;
  /**
   * A NeubrdfTraversal.
   */
  uint32_t traversal;
  /**
   * Paths in flight, which bound the memory, 100 to 200 bytes each, 128 more where paths are shared; 0 takes what suits the device.
   */
  uint32_t pool_paths;
  /**
   * Recordings that may be pending at once; 0 is 3.
   */
  uint32_t frames_in_flight;
  /**
   * Not 0 if albedo, normal and depth are wanted as targets.
   */
  uint32_t features;
  /**
   * Bits of NeubrdfReserve.
   */
  uint32_t reserve;
  /**
   * The part of the film to render, as x, y, width, height; a width of 0 is all of it.
   */
  uint32_t crop[4];
  /**
   * NeuBRDFs that there may be, if those are more than the scene has.
   */
  uint32_t neubrdf_count;
  /**
   * What a path may bring of indirect light, in any channel; 0 is no limit. It ends fireflies and takes light away.
   */
  float clamp_indirect;
  /**
   * Not 0 if neighbouring pixels shall share paths between diffuse surfaces: less noise of indirect light, at a price. Not for scenes with holes.
   */
  uint32_t path_reuse;
} NeubrdfOptions;

/**
 * A host's image or buffer that a frame is written to; the one that is not VK_NULL_HANDLE. Both need the usage TRANSFER_DST.
 * On entry what the host did to them is done for the stage TRANSFER; on exit they are written in the stage TRANSFER.
 */
typedef struct NeubrdfTarget {
  /**
   * sizeof(NeubrdfTarget).
   */
  uint32_t size;
  /**
   * A NeubrdfFormat.
   */
  uint32_t format;
  /**
   * A NeubrdfChannel.
   */
  uint32_t channel;
  /**
   * 8-bit formats show radiance · 2^exposure.
   */
  float exposure;
  /**
   * Two-dimensional, one sample a texel, of a colour format whose texels are as many bytes as the format's.
   */
  VkImage image;
  /**
   * Its layout before; VK_IMAGE_LAYOUT_UNDEFINED drops its texels.
   */
  VkImageLayout layout_before;
  /**
   * Its layout afterwards; with UNDEFINED for both, it is taken to be in TRANSFER_DST_OPTIMAL and stays in it.
   */
  VkImageLayout layout_after;
  /**
   * Where in it the picture's upper left pixel goes.
   */
  uint32_t origin[2];
  /**
   * A buffer instead.
   */
  VkBuffer buffer;
  /**
   * Where in it the picture begins, in bytes.
   */
  uint64_t buffer_offset;
  /**
   * How many bytes there are for it.
   */
  uint64_t buffer_bytes;
  /**
   * Texels of the image across and down, so that one that is too small for the film is an error; 0 for both if it is large enough for certain.
   */
  uint32_t image_size[2];
} NeubrdfTarget;

/**
 * What a frame is to do.
 */
typedef struct NeubrdfFrame {
  /**
   * sizeof(NeubrdfFrame).
   */
  uint32_t size;
  /**
   * More samples of every pixel; 0 only writes the picture so far.
   */
  uint32_t samples;
  /**
   * Where the picture goes.
   */
  const struct NeubrdfTarget *targets;
  /**
   * How many there are.
   */
  uint32_t target_count;
  /**
   * Not 0 if the estimated error is wanted.
   */
  uint32_t estimates_error;
} NeubrdfFrame;

/**
 * How a render stood after a frame.
 */
typedef struct NeubrdfStatus {
  /**
   * sizeof(NeubrdfStatus).
   */
  uint32_t size;
  /**
   * Samples a pixel that are in the frame's picture; 0 if the number was no frame's, or a later frame has taken its place.
   */
  uint32_t samples;
  /**
   * The estimated relative error of that picture; below 0 where there is none, as before the fourth sample.
   */
  double error;
  /**
   * Samples so far that were not finite; they count as black.
   */
  uint32_t rejected;
  /**
   * Nothing.
   */
  uint32_t reserved;
} NeubrdfStatus;

/**
 * Vertices of a mesh that lie elsewhere, on the CPU, on the device, or on both.
 */
typedef struct NeubrdfDeformation {
  /**
   * sizeof(NeubrdfDeformation).
   */
  uint32_t size;
  /**
   * A NeubrdfUpdate: how what finds the mesh's triangles follows.
   */
  uint32_t by;
  /**
   * How many vertices there are: as many as at first.
   */
  uint32_t vertex_count;
  /**
   * Bytes from a position on the device to the next; 0 is 12.
   */
  uint32_t position_stride;
  /**
   * x, y, z of each vertex, copied; null for a mesh that only the device has.
   */
  const float *positions;
  /**
   * Unit normals, copied; null for a flat mesh, and for one that only the device has.
   */
  const float *normals;
  /**
   * Where the device reads the positions, in the next frame, as of a NeubrdfDeviceMesh; 0 uploads those above.
   */
  VkDeviceAddress device_positions;
  /**
   * Where it then reads the normals; 0 for a flat mesh.
   */
  VkDeviceAddress device_normals;
  /**
   * Bytes from a normal on the device to the next; 0 is 12.
   */
  uint32_t normal_stride;
  /**
   * Lower corner of a box around the vertices of a mesh that only the device has.
   */
  float lower[3];
  /**
   * Its upper corner.
   */
  float upper[3];
  /**
   * Nothing: 0.
   */
  uint32_t reserved;
} NeubrdfDeformation;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/**
 * The words of the last call on this thread that did not return NEUBRDF_RESULT_OK: UTF-8, valid until the next such call. Empty
 * if there was none; never null.
 */
const char *neubrdf_last_error(void);

/**
 * The library's version as 10⁶ major + 10³ minor + patch.
 */
uint32_t neubrdf_version(void);

/**
 * Asks what a physical device is to be opened with. The instance is for Vulkan 1.2 or later.
 *
 * The handles belong together; `requirements` points to room for a pointer.
 */
enum NeubrdfResult neubrdf_requirements_create(PFN_vkGetInstanceProcAddr get_instance_proc_addr,
                                               VkInstance instance,
                                               VkPhysicalDevice physical_device,
                                               struct NeubrdfRequirements **requirements);

/**
 * What makes the device unfit, by Vulkan's names, separated by commas; empty for a fit one. Valid as long as the requirements.
 *
 * The object is alive, or null.
 */
const char *neubrdf_requirements_missing(const struct NeubrdfRequirements *requirements);

/**
 * Not 0 if the device has ray query, which is then asked for too, unless the last merge declined it.
 *
 * The object is alive, or null.
 */
uint32_t neubrdf_requirements_has_ray_query(const struct NeubrdfRequirements *requirements);

/**
 * Adds what is needed to what the host enables anyway: extensions to the list, features to the structures of the pNext chain that
 * hold them, and structures of our own for what no structure there holds. `wants_ray_query` of 0 declines ray query: rays then
 * walk a BVH in a compute shader. The requirements must live until vkCreateDevice returns. To ask once more, say because vkCreateDevice
 * refused, begin with an `info`, and structures of its chain, as they were before.
 *
 * `info`, its chain and its names are valid; the structures of the chain may be written to.
 */
enum NeubrdfResult neubrdf_requirements_merge(struct NeubrdfRequirements *requirements,
                                              uint32_t wants_ray_query,
                                              VkDeviceCreateInfo *info);

/**
 * Ends the requirements.
 *
 * The object is alive, or null.
 */
void neubrdf_requirements_destroy(struct NeubrdfRequirements *requirements);

/**
 * Borrows a host's device.
 *
 * The handles belong together and outlive the context and all that is made from it; the device was made with what the
 * requirements say.
 */
enum NeubrdfResult neubrdf_context_create(const struct NeubrdfHost *host, struct NeubrdfContext **context);

/**
 * Ends the context; renderers made from it stay alive.
 *
 * The object is alive, or null.
 */
void neubrdf_context_destroy(struct NeubrdfContext *context);

/**
 * Loads a scene file (.toml) or an OBJ file (UTF-8 path).
 *
 * `file` is a C string; `scene` points to room for a pointer.
 */
enum NeubrdfResult neubrdf_scene_load(const char *file, struct NeubrdfScene **scene);

/**
 * An empty scene, seen from (0, 0, 1) towards the origin, of 512 × 512 pixels, without light. It needs a material, a mesh and an instance
 * before it can be rendered.
 *
 * `scene` points to room for a pointer.
 */
enum NeubrdfResult neubrdf_scene_create(struct NeubrdfScene **scene);

/**
 * Ends the scene; renderers made from it stay alive.
 *
 * The object is alive, or null.
 */
void neubrdf_scene_destroy(struct NeubrdfScene *scene);

/**
 * What was left out or mended while loading: the words of the warning of that index, valid as long as the scene; null beyond the last.
 *
 * The object is alive, or null.
 */
const char *neubrdf_scene_warning(const struct NeubrdfScene *scene,
                                  uint32_t index);

/**
 * Sets the camera.
 *
 * Both objects are alive.
 */
enum NeubrdfResult neubrdf_scene_set_camera(struct NeubrdfScene *scene, const struct NeubrdfCamera *camera);

/**
 * Sets the size of the picture in pixels.
 *
 * The object is alive.
 */
enum NeubrdfResult neubrdf_scene_set_film(struct NeubrdfScene *scene, uint32_t width, uint32_t height);

/**
 * Adds a texture of width × height linear RGB texels, row by row from the top. `index`, if not null, is told its index.
 *
 * `texels` points to 3 · width · height floats; `index` is null or points to room for a number.
 */
enum NeubrdfResult neubrdf_scene_add_texture(struct NeubrdfScene *scene,
                                             uint32_t width,
                                             uint32_t height,
                                             const float *texels,
                                             uint32_t *index);

/**
 * Says where a texture lies: at texture coordinates (u, v) it is looked up at `offset` + `scale` · (u, v). A texture that nobody places has a scale
 * of 1 and an offset of 0.
 *
 * `scale` and `offset` point to two floats each.
 */
enum NeubrdfResult neubrdf_scene_place_texture(struct NeubrdfScene *scene,
                                               uint32_t index,
                                               const float *scale,
                                               const float *offset);

/**
 * Adds a material.
 *
 * `index` is null or points to room for a number; the others are alive.
 */
enum NeubrdfResult neubrdf_scene_add_material(struct NeubrdfScene *scene,
                                              const struct NeubrdfMaterial *material,
                                              uint32_t *index);

/**
 * Adds a mesh. It is seen where instances of it stand.
 *
 * The arrays have the lengths that the mesh says; `index` is null or points to room for a number.
 */
enum NeubrdfResult neubrdf_scene_add_mesh(struct NeubrdfScene *scene, const struct NeubrdfMesh *mesh, uint32_t *index);

/**
 * Places a mesh in the world, by the upper three rows of a matrix, row by row; null is where it is.
 *
 * `object_to_world` is null or points to twelve floats; `index` is null or points to room for a number.
 */
enum NeubrdfResult neubrdf_scene_add_instance(struct NeubrdfScene *scene,
                                              uint32_t mesh,
                                              const float *object_to_world,
                                              uint32_t *index);

/**
 * Sets the sky: width × height radiances, row by row from the zenith (y up), of which each fills its part of the sphere; a sky of one
 * texel is the same all around. Null is no sky.
 *
 * `texels` is null or points to 3 · width · height floats.
 */
enum NeubrdfResult neubrdf_scene_set_environment(struct NeubrdfScene *scene,
                                                 uint32_t width,
                                                 uint32_t height,
                                                 const float *texels,
                                                 float rotation_degrees);

/**
 * Sets the sun: a vector towards it, and the irradiance on a surface that faces it, W/m². Null is no sun.
 *
 * Each is null or points to three floats.
 */
enum NeubrdfResult neubrdf_scene_set_sun(struct NeubrdfScene *scene, const float *direction, const float *irradiance);

/**
 * Adds a mesh that the device has. `arrays`, if not null, are the same vertices and triangles on the CPU, copied: the BVH and triangles that
 * emit need them, and the materials are then theirs. Without them rays find it by ray query alone.
 *
 * The buffers are of the device of every context that a renderer of this scene is made on, belong to the queue's family or are shared, have as
 * many vertices and triangles, of finite numbers, and live until that renderer's first recording is done. `arrays` is null or as of
 * `neubrdf_scene_add_mesh`; `index` is null or points to room for a number.
 */
enum NeubrdfResult neubrdf_scene_add_device_mesh(struct NeubrdfScene *scene,
                                                 const struct NeubrdfDeviceMesh *mesh,
                                                 const struct NeubrdfMesh *arrays,
                                                 uint32_t *index);

/**
 * Makes a renderer: trees and tables on the CPU, kernels, memory. Nothing is submitted. It takes as long as the driver compiles, and may
 * be called on any thread. `options` may be null.
 *
 * The objects are alive; `renderer` points to room for a pointer.
 */
enum NeubrdfResult neubrdf_renderer_create(const struct NeubrdfContext *context,
                                           const struct NeubrdfScene *scene,
                                           const struct NeubrdfOptions *options,
                                           struct NeubrdfRenderer **renderer);

/**
 * Ends the renderer. All that it recorded is done by then.
 *
 * The object is alive, or null, and the device works on none of its recordings.
 */
void neubrdf_renderer_destroy(struct NeubrdfRenderer *renderer);

/**
 * A copy of the scene as it is now, with all changes, for a new renderer where NEUBRDF_RESULT_NEW_RENDERER says that it takes one: the call of
 * `neubrdf_scene_` that is named as the one that was refused changes the copy. The caller ends it. It has no warnings. A sky or a sun
 * that was reserved and is not there is a black one.
 *
 * A mesh that came from the host's buffers does so again: the new renderer's first recording reads them, the vertices from where a deformation
 * read them last, and then they must still be there. If a deformation gave them on the CPU, the mesh is in the scene whole: with the texture coordinates
 * that its arrays had.
 *
 * The object is alive; `scene` points to room for a pointer.
 */
enum NeubrdfResult neubrdf_renderer_scene(const struct NeubrdfRenderer *renderer,
                                          struct NeubrdfScene **scene);

/**
 * Pixels across and down: what a target must have room for. Samples a pixel that the recordings so far take.
 *
 * The object is alive; each of the others is null or points to room for a number.
 */
enum NeubrdfResult neubrdf_renderer_size(struct NeubrdfRenderer *renderer,
                                         uint32_t *width,
                                         uint32_t *height,
                                         uint32_t *samples);

/**
 * Records what the next frame would otherwise upload first. Counts as a frame in flight. `ticket`, if not null, is told its number.
 *
 * As of `neubrdf_renderer_record`.
 */
enum NeubrdfResult neubrdf_renderer_record_upload(struct NeubrdfRenderer *renderer,
                                                  VkCommandBuffer command_buffer,
                                                  uint64_t *ticket);

/**
 * Records a frame: what changed, more samples, and the picture's way to the targets. Nothing is submitted, waited for or allocated on the
 * device. `ticket`, if not null, is told the recording's number. Command buffers are submitted once each, in the order of the recordings,
 * on queues that keep that order. After an error the command buffer must not be submitted.
 *
 * The command buffer is of the context's device, in the recording state, outside a render pass, on a queue that computes. Targets live until
 * it is done. What was bound for compute before is bound no more.
 */
enum NeubrdfResult neubrdf_renderer_record(struct NeubrdfRenderer *renderer,
                                           VkCommandBuffer command_buffer,
                                           const struct NeubrdfFrame *frame,
                                           uint64_t *ticket);

/**
 * The host knows that the recording of that number and all before it are done: gives back what they alone used. `status`, if not null, is
 * told what the frame left. It never waits.
 *
 * The object is alive, and the device is done with these recordings.
 */
enum NeubrdfResult neubrdf_renderer_complete(struct NeubrdfRenderer *renderer,
                                             uint64_t ticket,
                                             struct NeubrdfStatus *status);

/**
 * The recording of that number and all after it will never be submitted: the next one uploads what they were to, goes on from the samples that
 * were taken before them, and has that number. Meshes in the host's buffers that they were to read, the next one reads. NEUBRDF_RESULT_INVALID_ARGUMENT if no recording of that number is in flight.
 *
 * The object is alive, and these recordings were not submitted.
 */
enum NeubrdfResult neubrdf_renderer_abandon(struct NeubrdfRenderer *renderer,
                                            uint64_t ticket);

/**
 * For a host whose own call returned VK_ERROR_DEVICE_LOST: returns NEUBRDF_RESULT_DEVICE_LOST, and `neubrdf_last_error` says how far the oldest
 * recording came that is not known to be done.
 *
 * The object is alive.
 */
enum NeubrdfResult neubrdf_renderer_device_lost(struct NeubrdfRenderer *renderer);

/**
 * The next frame begins with a black film.
 *
 * The object is alive.
 */
enum NeubrdfResult neubrdf_renderer_reset(struct NeubrdfRenderer *renderer);

/**
 * Gives the film another size, as of a window, and begins anew.
 *
 * The object is alive.
 */
enum NeubrdfResult neubrdf_renderer_resize(struct NeubrdfRenderer *renderer, uint32_t width, uint32_t height);

/**
 * Another view, from the next frame on.
 *
 * Both are alive.
 */
enum NeubrdfResult neubrdf_renderer_set_camera(struct NeubrdfRenderer *renderer, const struct NeubrdfCamera *camera);

/**
 * How the top level over all instances follows changes from now on: a NeubrdfUpdate; at first it is rebuilt each time.
 *
 * The object is alive.
 */
enum NeubrdfResult neubrdf_renderer_set_top_level(struct NeubrdfRenderer *renderer, uint32_t by);

/**
 * Moves `count` instances, from the next frame on: the indices, and twelve floats for each, the upper three rows of its matrix. The top level
 * over all instances follows, once.
 *
 * The arrays have these lengths.
 */
enum NeubrdfResult neubrdf_renderer_set_transforms(struct NeubrdfRenderer *renderer,
                                                   const uint32_t *instances,
                                                   const float *object_to_world,
                                                   uint32_t count);

/**
 * Moves instances of a scene: as of `neubrdf_renderer_set_transforms`.
 *
 * The arrays have these lengths.
 */
enum NeubrdfResult neubrdf_scene_set_transforms(struct NeubrdfScene *scene,
                                                const uint32_t *instances,
                                                const float *object_to_world,
                                                uint32_t count);

/**
 * Other instances, `count` of them, at least one, from the next frame on: the mesh of each, and twelve floats, the upper three rows of its
 * matrix. The top level over all instances is rebuilt where they are more, fewer or of other meshes.
 *
 * The arrays have these lengths.
 */
enum NeubrdfResult neubrdf_renderer_set_instances(struct NeubrdfRenderer *renderer,
                                                  const uint32_t *meshes,
                                                  const float *object_to_world,
                                                  uint32_t count);

/**
 * Other instances of a scene: as of `neubrdf_renderer_set_instances`.
 *
 * The arrays have these lengths.
 */
enum NeubrdfResult neubrdf_scene_set_instances(struct NeubrdfScene *scene,
                                               const uint32_t *meshes,
                                               const float *object_to_world,
                                               uint32_t count);

/**
 * Another shape of a mesh, from the next frame on: its vertices lie elsewhere, its triangles connect the same ones.
 *
 * The arrays have these lengths; the vertices on the device are as of `neubrdf_scene_add_device_mesh`.
 */
enum NeubrdfResult neubrdf_renderer_deform(struct NeubrdfRenderer *renderer,
                                           uint32_t mesh,
                                           const struct NeubrdfDeformation *deformation);

/**
 * Another shape of a scene's mesh: as of `neubrdf_renderer_deform`. `by` changes nothing here.
 *
 * The arrays have these lengths; the vertices on the device are as of `neubrdf_scene_add_device_mesh`.
 */
enum NeubrdfResult neubrdf_scene_deform(struct NeubrdfScene *scene,
                                        uint32_t mesh,
                                        const struct NeubrdfDeformation *deformation);

/**
 * Another material, from the next frame on.
 *
 * Both are alive.
 */
enum NeubrdfResult neubrdf_renderer_set_material(struct NeubrdfRenderer *renderer,
                                                 uint32_t index,
                                                 const struct NeubrdfMaterial *material);

/**
 * Another material in the place of one of a scene.
 *
 * Both are alive.
 */
enum NeubrdfResult neubrdf_scene_set_material(struct NeubrdfScene *scene,
                                              uint32_t index,
                                              const struct NeubrdfMaterial *material);

/**
 * Another sky, from the next frame on: as of `neubrdf_scene_set_environment`.
 *
 * `texels` is null or points to 3 · width · height floats.
 */
enum NeubrdfResult neubrdf_renderer_set_environment(struct NeubrdfRenderer *renderer,
                                                    uint32_t width,
                                                    uint32_t height,
                                                    const float *texels,
                                                    float rotation_degrees);

/**
 * Another sun, from the next frame on: as of `neubrdf_scene_set_sun`.
 *
 * Each is null or points to three floats.
 */
enum NeubrdfResult neubrdf_renderer_set_sun(struct NeubrdfRenderer *renderer,
                                            const float *direction,
                                            const float *irradiance);

/**
 * Adds a material of a file: .neubrdf, .toml, MERL .binary, RGL .bsdf, NBRDF .safetensors, sparse .csv. `name` picks one of a file that holds
 * several, else it is null. With maps or emission: add another one with NEUBRDF_SURFACE_OF_MATERIAL.
 *
 * `file` is a C string, `name` one or null; `index` is null or points to room for a number.
 */
enum NeubrdfResult neubrdf_scene_add_material_file(struct NeubrdfScene *scene,
                                                   const char *file,
                                                   const char *name,
                                                   uint32_t *index);

/**
 * Adds a material of the bytes of a .neubrdf file, which are copied. `name` picks one of a file that holds several, else it is null. `label` is
 * what errors call the bytes; null is a name of ours. Any bytes will do: what is no such file is NEUBRDF_RESULT_SCENE, and the scene is as before.
 *
 * `bytes` points to as many bytes as `size` says, or is null where that is 0; `name` and `label` are C strings or null; `index` is null or
 * points to room for a number.
 */
enum NeubrdfResult neubrdf_scene_add_material_memory(struct NeubrdfScene *scene,
                                                     const void *bytes,
                                                     uint64_t size,
                                                     const char *name,
                                                     const char *label,
                                                     uint32_t *index);

/**
 * Another material, from the next frame on, of a file as of `neubrdf_scene_add_material_file`; it does not emit. The file's BRDF is
 * shared with the materials that have it already, or takes the place of one that no other material has: a material may become another and
 * be set back as often as one likes. What would be a warning there is an error here.
 *
 * `file` is a C string, `name` one or null; the renderer is alive.
 */
enum NeubrdfResult neubrdf_renderer_set_material_file(struct NeubrdfRenderer *renderer,
                                                      uint32_t index,
                                                      const char *file,
                                                      const char *name);

/**
 * Another material in the place of one of a scene: as of `neubrdf_renderer_set_material_file`.
 *
 * `file` is a C string, `name` one or null; the scene is alive.
 */
enum NeubrdfResult neubrdf_scene_set_material_file(struct NeubrdfScene *scene,
                                                   uint32_t index,
                                                   const char *file,
                                                   const char *name);

/**
 * Another material, from the next frame on, of the bytes of a .neubrdf file: as of `neubrdf_scene_add_material_memory` and
 * `neubrdf_renderer_set_material_file`.
 *
 * As of `neubrdf_scene_add_material_memory`; the renderer is alive.
 */
enum NeubrdfResult neubrdf_renderer_set_material_memory(struct NeubrdfRenderer *renderer,
                                                        uint32_t index,
                                                        const void *bytes,
                                                        uint64_t size,
                                                        const char *name,
                                                        const char *label);

/**
 * Another material in the place of one of a scene: as of `neubrdf_renderer_set_material_memory`.
 *
 * As of `neubrdf_scene_add_material_memory`.
 */
enum NeubrdfResult neubrdf_scene_set_material_memory(struct NeubrdfScene *scene,
                                                     uint32_t index,
                                                     const void *bytes,
                                                     uint64_t size,
                                                     const char *name,
                                                     const char *label);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* NEUBRDF_H */
