// A small engine in C++: its own instance, device, queue, command buffer and image, under synchronization validation. It renders an
// OBJ file, or a scene that it makes itself and then changes, into its image, a few frames in flight, and writes the pixels to a file; of a
// scene that it made, then those of a new renderer, to a file whose name ends in `.renewed`.
// A mesh of the made scene is in a vertex buffer of the engine's: with a copy on the CPU, for the BVH, or without one, for ray query.
//
//   host SCENE PIXELS DEVICE [MATERIAL OTHER THIRD]      SCENE: a file, `made`, or `made-on-device`; then the last are files of three materials
#include "neubrdf.h"

#include <vulkan/vulkan.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <mutex>
#include <string>
#include <vector>

static int messages = 0;

static void check(VkResult result, const char* call) {
    if (result != VK_SUCCESS) {
        std::fprintf(stderr, "%s: %d\n", call, result);
        std::exit(1);
    }
}

static void check(NeubrdfResult result, const char* call) {
    if (result != NEUBRDF_RESULT_OK) {
        std::fprintf(stderr, "%s: %d: %s\n", call, result, neubrdf_last_error());
        std::exit(1);
    }
}

#define CHECK(call) check(call, #call)

static VKAPI_ATTR VkBool32 VKAPI_CALL receive(VkDebugUtilsMessageSeverityFlagBitsEXT, VkDebugUtilsMessageTypeFlagsEXT,
                                              const VkDebugUtilsMessengerCallbackDataEXT* data, void*) {
    std::printf("%s\n", data->pMessage);
    messages += 1;
    return VK_FALSE;
}

// What an engine has anyway.
struct Engine {
    VkInstance instance;
    VkDebugUtilsMessengerEXT messenger;
    VkPhysicalDevice physical;
    VkDevice device;
    VkQueue queue;
    VkCommandPool pool;
    bool ray_query;

    explicit Engine(const char* name);
    ~Engine();
    uint32_t memory_type(uint32_t bits, VkMemoryPropertyFlags flags) const;
    VkDeviceMemory allocate(const VkMemoryRequirements& needs, VkMemoryPropertyFlags flags,
                            VkMemoryAllocateFlags for_addresses = 0) const;
};

Engine::Engine(const char* name) {
    VkApplicationInfo application{VK_STRUCTURE_TYPE_APPLICATION_INFO};
    application.apiVersion = VK_API_VERSION_1_2;
    const char* layer = "VK_LAYER_KHRONOS_validation";
    const char* extensions[] = {VK_EXT_DEBUG_UTILS_EXTENSION_NAME, VK_EXT_VALIDATION_FEATURES_EXTENSION_NAME};
    VkValidationFeatureEnableEXT enable = VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION_EXT;
    VkValidationFeaturesEXT validation{VK_STRUCTURE_TYPE_VALIDATION_FEATURES_EXT};
    validation.enabledValidationFeatureCount = 1;
    validation.pEnabledValidationFeatures = &enable;
    VkInstanceCreateInfo info{VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO};
    info.pNext = &validation;
    info.pApplicationInfo = &application;
    info.enabledLayerCount = 1;
    info.ppEnabledLayerNames = &layer;
    info.enabledExtensionCount = 2;
    info.ppEnabledExtensionNames = extensions;
    CHECK(vkCreateInstance(&info, nullptr, &instance));

    auto create = (PFN_vkCreateDebugUtilsMessengerEXT)vkGetInstanceProcAddr(instance, "vkCreateDebugUtilsMessengerEXT");
    VkDebugUtilsMessengerCreateInfoEXT listen{VK_STRUCTURE_TYPE_DEBUG_UTILS_MESSENGER_CREATE_INFO_EXT};
    listen.messageSeverity =
        VK_DEBUG_UTILS_MESSAGE_SEVERITY_WARNING_BIT_EXT | VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT;
    listen.messageType = VK_DEBUG_UTILS_MESSAGE_TYPE_VALIDATION_BIT_EXT;
    listen.pfnUserCallback = receive;
    CHECK(create(instance, &listen, nullptr, &messenger));

    uint32_t count = 16;
    VkPhysicalDevice devices[16];
    vkEnumeratePhysicalDevices(instance, &count, devices);
    physical = VK_NULL_HANDLE;
    for (uint32_t i = 0; i < count; ++i) {
        VkPhysicalDeviceProperties properties;
        vkGetPhysicalDeviceProperties(devices[i], &properties);
        if (std::strstr(properties.deviceName, name)) physical = devices[i];
    }
    if (!physical) {
        std::fprintf(stderr, "no device %s\n", name);
        std::exit(1);
    }

    // What neubrdf wants is merged with what the engine wants.
    NeubrdfRequirements* requirements;
    CHECK(neubrdf_requirements_create(vkGetInstanceProcAddr, instance, physical, &requirements));
    if (*neubrdf_requirements_missing(requirements)) {
        std::fprintf(stderr, "unfit: %s\n", neubrdf_requirements_missing(requirements));
        std::exit(1);
    }
    ray_query = neubrdf_requirements_has_ray_query(requirements) != 0;
    float priority = 1.0f;
    VkDeviceQueueCreateInfo queues{VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO};
    queues.queueCount = 1;
    queues.pQueuePriorities = &priority;
    VkPhysicalDeviceVulkan12Features features{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES};
    features.hostQueryReset = VK_TRUE;
    VkDeviceCreateInfo device_info{VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO};
    device_info.pNext = &features;
    device_info.queueCreateInfoCount = 1;
    device_info.pQueueCreateInfos = &queues;
    // As if a first vkCreateDevice had refused.
    VkPhysicalDeviceVulkan12Features refused_features = features;
    VkDeviceCreateInfo refused = device_info;
    refused.pNext = &refused_features;
    CHECK(neubrdf_requirements_merge(requirements, 0, &refused));
    if (neubrdf_requirements_has_ray_query(requirements)) std::exit(1);
    CHECK(neubrdf_requirements_merge(requirements, 1, &device_info));
    if (refused.pNext != &refused_features || refused.enabledExtensionCount > device_info.enabledExtensionCount) std::exit(1);
    CHECK(vkCreateDevice(physical, &device_info, nullptr, &device));
    neubrdf_requirements_destroy(requirements);

    vkGetDeviceQueue(device, 0, 0, &queue);
    VkCommandPoolCreateInfo pool_info{VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO};
    CHECK(vkCreateCommandPool(device, &pool_info, nullptr, &pool));
}

Engine::~Engine() {
    vkDestroyCommandPool(device, pool, nullptr);
    vkDestroyDevice(device, nullptr);
    auto destroy =
        (PFN_vkDestroyDebugUtilsMessengerEXT)vkGetInstanceProcAddr(instance, "vkDestroyDebugUtilsMessengerEXT");
    destroy(instance, messenger, nullptr);
    vkDestroyInstance(instance, nullptr);
}

uint32_t Engine::memory_type(uint32_t bits, VkMemoryPropertyFlags flags) const {
    VkPhysicalDeviceMemoryProperties memory;
    vkGetPhysicalDeviceMemoryProperties(physical, &memory);
    for (uint32_t i = 0; i < memory.memoryTypeCount; ++i) {
        if ((bits >> i & 1) && (memory.memoryTypes[i].propertyFlags & flags) == flags) return i;
    }
    std::exit(1);
}

VkDeviceMemory Engine::allocate(const VkMemoryRequirements& needs, VkMemoryPropertyFlags flags,
                                VkMemoryAllocateFlags for_addresses) const {
    VkMemoryAllocateFlagsInfo allocate_flags{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_FLAGS_INFO};
    allocate_flags.flags = for_addresses;
    VkMemoryAllocateInfo info{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO};
    info.pNext = &allocate_flags;
    info.allocationSize = needs.size;
    info.memoryTypeIndex = memory_type(needs.memoryTypeBits, flags);
    VkDeviceMemory memory;
    CHECK(vkAllocateMemory(device, &info, nullptr, &memory));
    return memory;
}

static const float positions[] = {-1, 0, 1, 1, 0, 1, 1, 0, -1, -1, 0, -1};
static const float bent_positions[] = {-1, 0.25f, 1, 1, 0, 1, 1, 0, -1, -1, 0, -1};
static const float uvs[] = {0, 0, 1, 0, 1, 1, 0, 1};
static const uint32_t indices[] = {0, 1, 2, 0, 2, 3};

// A square as engines have it: vertices of position and texture coordinates, and indices of 16 bits, in one buffer. Behind them the
// positions of another moment.
struct Square {
    const Engine& engine;
    VkBuffer buffer;
    VkDeviceMemory memory;
    VkDeviceAddress address;

    static constexpr VkDeviceSize stride = 20, indices_at = 80, bent_at = 92, bytes = 140;
    explicit Square(const Engine& engine);
    ~Square();
};

Square::Square(const Engine& engine) : engine(engine) {
    VkBufferCreateInfo info{VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO};
    info.size = bytes;
    info.usage = VK_BUFFER_USAGE_VERTEX_BUFFER_BIT | VK_BUFFER_USAGE_INDEX_BUFFER_BIT |
                 VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;
    CHECK(vkCreateBuffer(engine.device, &info, nullptr, &buffer));
    VkMemoryRequirements needs;
    vkGetBufferMemoryRequirements(engine.device, buffer, &needs);
    memory = engine.allocate(needs, VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT,
                             VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT);
    CHECK(vkBindBufferMemory(engine.device, buffer, memory, 0));
    void* mapped;
    CHECK(vkMapMemory(engine.device, memory, 0, bytes, 0, &mapped));
    char* out = static_cast<char*>(mapped);
    for (int vertex = 0; vertex < 4; ++vertex) {
        std::memcpy(out + stride * vertex, positions + 3 * vertex, 12);
        std::memcpy(out + stride * vertex + 12, uvs + 2 * vertex, 8);
    }
    for (int corner = 0; corner < 6; ++corner) {
        const uint16_t index = uint16_t(indices[corner]);
        std::memcpy(out + indices_at + 2 * corner, &index, 2);
    }
    std::memcpy(out + bent_at, bent_positions, sizeof bent_positions);
    vkUnmapMemory(engine.device, memory);
    VkBufferDeviceAddressInfo address_info{VK_STRUCTURE_TYPE_BUFFER_DEVICE_ADDRESS_INFO};
    address_info.buffer = buffer;
    address = vkGetBufferDeviceAddress(engine.device, &address_info);
}

Square::~Square() {
    vkDestroyBuffer(engine.device, buffer, nullptr);
    vkFreeMemory(engine.device, memory, nullptr);
}

// The engine's allocator, as simple as can be: a VkDeviceMemory each.
struct Allocator {
    const Engine& engine;
    std::mutex mutex;
    int given = 0, alive = 0;
};

static int32_t allocate(void* user, const NeubrdfMemoryRequest* request, NeubrdfMemory* memory) {
    Allocator& allocator = *static_cast<Allocator*>(user);
    const std::lock_guard<std::mutex> guard(allocator.mutex);
    const VkMemoryRequirements needs{request->bytes, request->alignment, request->memory_type_bits};
    const VkMemoryPropertyFlags visible = VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;
    const VkMemoryPropertyFlags local = VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT;
    const bool on_device = request->memory_use == NEUBRDF_MEMORY_USE_DEVICE;
    memory->properties = on_device ? local : visible;
    memory->memory = allocator.engine.allocate(needs, memory->properties, VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT);
    if (!on_device) {
        CHECK(vkMapMemory(allocator.engine.device, memory->memory, 0, VK_WHOLE_SIZE, 0, &memory->mapped));
    }
    memory->handle = &allocator.given;
    allocator.given += 1;
    allocator.alive += 1;
    return 0;
}

static void release(void* user, const NeubrdfMemory* memory) {
    Allocator& allocator = *static_cast<Allocator*>(user);
    const std::lock_guard<std::mutex> guard(allocator.mutex);
    if (memory->handle != &allocator.given) std::exit(1);
    vkFreeMemory(allocator.engine.device, memory->memory, nullptr);
    allocator.alive -= 1;
}

static NeubrdfCamera camera_at(float x, float y, float z) {
    NeubrdfCamera camera{};
    camera.size = sizeof camera;
    camera.vertical_fov_degrees = 45.0f;
    camera.eye[0] = x, camera.eye[1] = y, camera.eye[2] = z;
    camera.up[1] = 1.0f;
    return camera;
}

static NeubrdfMaterial material_of(NeubrdfSurface surface, float grey, float alpha) {
    NeubrdfMaterial material{};
    material.size = sizeof material;
    material.surface = surface;
    material.color[0] = material.color[1] = material.color[2] = grey;
    material.alpha[0] = material.alpha[1] = alpha;
    return material;
}

static std::vector<char> bytes_of(const char* file) {
    std::FILE* in = std::fopen(file, "rb");
    if (!in) std::exit(1);
    std::vector<char> bytes;
    for (int byte = std::fgetc(in); byte != EOF; byte = std::fgetc(in)) bytes.push_back(char(byte));
    std::fclose(in);
    return bytes;
}

// A textured floor and a metal square above it, under a grey sky and a sun.
static NeubrdfScene* make_scene(const Square& square, bool on_device, const char* file) {
    NeubrdfScene* scene;
    CHECK(neubrdf_scene_create(&scene));
    const float texels[] = {1.0f, 0.5f, 0.25f, 0.25f, 0.5f, 1.0f};
    CHECK(neubrdf_scene_add_texture(scene, 2, 1, texels, nullptr));
    const float scale[] = {2.0f, 1.0f}, offset[] = {0.25f, 0.0f};
    CHECK(neubrdf_scene_place_texture(scene, 0, scale, offset));
    NeubrdfMaterial floor = material_of(NEUBRDF_SURFACE_DIFFUSE, 0.75f, 0.0f);
    floor.texture = 1;
    CHECK(neubrdf_scene_add_material(scene, &floor, nullptr));
    NeubrdfMaterial metal = material_of(NEUBRDF_SURFACE_CONDUCTOR, 0.5f, 0.25f);
    CHECK(neubrdf_scene_add_material(scene, &metal, nullptr));
    // No mesh has it: what is to come is no larger.
    const std::vector<char> bytes = bytes_of(file);
    if (on_device) CHECK(neubrdf_scene_add_material_memory(scene, bytes.data(), bytes.size(), nullptr, file, nullptr));
    else CHECK(neubrdf_scene_add_material_file(scene, file, nullptr, nullptr));
    NeubrdfMesh mesh{};
    mesh.size = sizeof mesh;
    mesh.vertex_count = 4;
    mesh.positions = positions;
    mesh.uvs = uvs;
    mesh.indices = indices;
    mesh.triangle_count = 2;
    CHECK(neubrdf_scene_add_mesh(scene, &mesh, nullptr));
    mesh.material = 1;
    NeubrdfDeviceMesh device_mesh{};
    device_mesh.size = sizeof device_mesh;
    device_mesh.vertex_count = 4;
    device_mesh.positions = square.address;
    device_mesh.position_stride = Square::stride;
    device_mesh.uvs = square.address + 12;
    device_mesh.uv_stride = Square::stride;
    device_mesh.indices = square.address + Square::indices_at;
    device_mesh.index_type = VK_INDEX_TYPE_UINT16;
    device_mesh.triangle_count = 2;
    device_mesh.material = 1;
    device_mesh.lower[0] = device_mesh.lower[2] = -1;
    device_mesh.upper[0] = device_mesh.upper[2] = 1;
    uint32_t index = 0;
    CHECK(neubrdf_scene_add_device_mesh(scene, &device_mesh, on_device ? nullptr : &mesh, &index));
    if (index != 1) std::exit(1);
    CHECK(neubrdf_scene_add_instance(scene, 0, nullptr, nullptr));
    const float above[] = {0.5f, 0, 0, 0, 0, 0.5f, 0, 0.5f, 0, 0, 0.5f, 0};
    CHECK(neubrdf_scene_add_instance(scene, 1, above, nullptr));
    NeubrdfCamera camera = camera_at(0, 2, 2);
    CHECK(neubrdf_scene_set_camera(scene, &camera));
    const float sky[] = {0.5f, 0.5f, 0.5f};
    CHECK(neubrdf_scene_set_environment(scene, 1, 1, sky, 0));
    const float towards[] = {0, 1, 0}, irradiance[] = {2, 2, 2};
    CHECK(neubrdf_scene_set_sun(scene, towards, irradiance));
    return scene;
}

// All that can change.
static void change(NeubrdfRenderer* renderer, const Square& square, bool on_device, char** files) {
    NeubrdfCamera camera = camera_at(1, 2, 2);
    CHECK(neubrdf_renderer_set_camera(renderer, &camera));
    const uint32_t instance = 1;
    const float higher[] = {0.5f, 0, 0, 0.25f, 0, 0.5f, 0, 0.75f, 0, 0, 0.5f, 0};
    CHECK(neubrdf_renderer_set_transforms(renderer, &instance, higher, 1));
    const uint32_t meshes[] = {1, 0};
    float both[24] = {};
    std::memcpy(both, higher, sizeof higher);
    both[12] = both[17] = both[22] = 1;
    CHECK(neubrdf_renderer_set_instances(renderer, meshes, both, 2));
    // Another shape, which the device reads from the engine's buffer.
    CHECK(neubrdf_renderer_set_top_level(renderer, NEUBRDF_UPDATE_REFIT));
    NeubrdfDeformation bent{};
    bent.size = sizeof bent;
    bent.by = NEUBRDF_UPDATE_REFIT;
    bent.vertex_count = 4;
    bent.device_positions = square.address + Square::bent_at;
    if (!on_device) bent.positions = bent_positions;
    bent.lower[0] = bent.lower[2] = -1;
    bent.upper[0] = bent.upper[2] = 1;
    bent.upper[1] = 0.25f;
    CHECK(neubrdf_renderer_deform(renderer, 1, &bent));
    NeubrdfMaterial floor = material_of(NEUBRDF_SURFACE_DIFFUSE, 0.5f, 0.0f);
    floor.texture = 1;
    CHECK(neubrdf_renderer_set_material(renderer, 0, &floor));
    // Those of files come and go, as in an editor; there is room for one NeuBRDF more than at first.
    NeubrdfMaterial metal = material_of(NEUBRDF_SURFACE_CONDUCTOR, 0.5f, 0.25f);
    for (int i = 0; i < 12; ++i) {
        CHECK(neubrdf_renderer_set_material_file(renderer, 1, files[i % 3], nullptr));
        CHECK(neubrdf_renderer_set_material(renderer, 1, &metal));
    }
    const std::vector<char> bytes = bytes_of(files[1]);
    CHECK(neubrdf_renderer_set_material_memory(renderer, 1, bytes.data(), bytes.size(), nullptr, nullptr));
    // The same once more, as an engine says it that adds maps to it.
    NeubrdfMaterial other = material_of(NEUBRDF_SURFACE_OF_MATERIAL, 0.0f, 0.0f);
    other.surface_of = 1;
    CHECK(neubrdf_renderer_set_material(renderer, 1, &other));
    const float sky[] = {0.25f, 0.5f, 0.75f};
    CHECK(neubrdf_renderer_set_environment(renderer, 1, 1, sky, 0));
    const float towards[] = {0, 1, 0}, irradiance[] = {1, 2, 1};
    CHECK(neubrdf_renderer_set_sun(renderer, towards, irradiance));
}

// What the kernels were not built for, and more, goes into a copy of the scene, for a new renderer in the place of the old one.
static NeubrdfRenderer* renewed(NeubrdfContext* context, NeubrdfRenderer* old, const NeubrdfOptions& options, bool on_device,
                                char** files) {
    NeubrdfMaterial coated = material_of(NEUBRDF_SURFACE_COATED, 0.5f, 0.25f);
    if (neubrdf_renderer_set_material(old, 0, &coated) != NEUBRDF_RESULT_NEW_RENDERER) std::exit(1);
    NeubrdfScene* scene;
    CHECK(neubrdf_renderer_scene(old, &scene));
    neubrdf_renderer_destroy(old);
    CHECK(neubrdf_scene_set_material(scene, 0, &coated));
    // One comes in the place of the other, as there is room for two NeuBRDFs.
    const std::vector<char> bytes = bytes_of(files[0]);
    CHECK(neubrdf_scene_set_material_memory(scene, 1, bytes.data(), bytes.size(), nullptr, nullptr));
    CHECK(neubrdf_scene_set_material_file(scene, 1, files[2], nullptr));
    const uint32_t meshes[] = {0, 1}, second = 1;
    const float both[24] = {1, 0, 0, 0, 0, 1, 0, -0.25f, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
    CHECK(neubrdf_scene_set_instances(scene, meshes, both, 2));
    const float above[] = {0.5f, 0, 0, 0, 0, 0.5f, 0, 0.5f, 0, 0, 0.5f, 0};
    CHECK(neubrdf_scene_set_transforms(scene, &second, above, 1));
    // The bent square lies in the engine's buffer, and is read from there again; or it becomes flat, on the CPU.
    NeubrdfDeformation flat{};
    flat.size = sizeof flat;
    flat.vertex_count = 4;
    flat.positions = positions;
    if (!on_device) CHECK(neubrdf_scene_deform(scene, 1, &flat));
    NeubrdfRenderer* renderer;
    CHECK(neubrdf_renderer_create(context, scene, &options, &renderer));
    neubrdf_scene_destroy(scene);
    return renderer;
}

static void write_pixels(const Engine& engine, VkDeviceMemory memory, VkDeviceSize bytes, const std::string& output) {
    void* pixels;
    CHECK(vkMapMemory(engine.device, memory, 0, bytes, 0, &pixels));
    std::FILE* out = std::fopen(output.c_str(), "wb");
    if (!out || std::fwrite(pixels, 1, bytes, out) != bytes || std::fclose(out) != 0) std::exit(1);
    vkUnmapMemory(engine.device, memory);
}

// The first frame of a renderer, of four samples, into a buffer.
static void render_once(const Engine& engine, NeubrdfRenderer* renderer, VkBuffer buffer, VkDeviceSize bytes) {
    VkCommandBufferAllocateInfo allocate{VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO};
    allocate.commandPool = engine.pool;
    allocate.commandBufferCount = 1;
    VkCommandBuffer commands;
    CHECK(vkAllocateCommandBuffers(engine.device, &allocate, &commands));
    VkCommandBufferBeginInfo begin{VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO};
    CHECK(vkBeginCommandBuffer(commands, &begin));
    NeubrdfTarget target{};
    target.size = sizeof target;
    target.format = NEUBRDF_FORMAT_RGBA32_FLOAT;
    target.buffer = buffer;
    target.buffer_bytes = bytes;
    NeubrdfFrame frame{};
    frame.size = sizeof frame;
    frame.samples = 4;
    frame.targets = &target;
    frame.target_count = 1;
    uint64_t ticket;
    CHECK(neubrdf_renderer_record(renderer, commands, &frame, &ticket));
    CHECK(vkEndCommandBuffer(commands));
    VkSubmitInfo submit{VK_STRUCTURE_TYPE_SUBMIT_INFO};
    submit.commandBufferCount = 1;
    submit.pCommandBuffers = &commands;
    CHECK(vkQueueSubmit(engine.queue, 1, &submit, VK_NULL_HANDLE));
    CHECK(vkQueueWaitIdle(engine.queue));
    CHECK(neubrdf_renderer_complete(renderer, ticket, nullptr));
}

static void render(const Engine& engine, const char* file, const char* output, char** materials) {
    const uint32_t width = 64, height = 48, frames = 4;
    const bool on_device = std::strcmp(file, "made-on-device") == 0;
    const bool is_made = on_device || std::strcmp(file, "made") == 0;
    const Square square(engine);
    const VkDeviceSize bytes = VkDeviceSize(width) * height * 16;

    // The engine's image, and memory to read it back through.
    VkImageCreateInfo image_info{VK_STRUCTURE_TYPE_IMAGE_CREATE_INFO};
    image_info.imageType = VK_IMAGE_TYPE_2D;
    image_info.format = VK_FORMAT_R32G32B32A32_SFLOAT;
    image_info.extent = {width, height, 1};
    image_info.mipLevels = image_info.arrayLayers = 1;
    image_info.samples = VK_SAMPLE_COUNT_1_BIT;
    image_info.usage = VK_IMAGE_USAGE_TRANSFER_DST_BIT | VK_IMAGE_USAGE_TRANSFER_SRC_BIT;
    VkImage image;
    CHECK(vkCreateImage(engine.device, &image_info, nullptr, &image));
    VkMemoryRequirements needs;
    vkGetImageMemoryRequirements(engine.device, image, &needs);
    VkDeviceMemory image_memory = engine.allocate(needs, VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT);
    CHECK(vkBindImageMemory(engine.device, image, image_memory, 0));
    VkBufferCreateInfo buffer_info{VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO};
    buffer_info.size = bytes;
    buffer_info.usage = VK_BUFFER_USAGE_TRANSFER_DST_BIT;
    VkBuffer buffer;
    CHECK(vkCreateBuffer(engine.device, &buffer_info, nullptr, &buffer));
    vkGetBufferMemoryRequirements(engine.device, buffer, &needs);
    VkDeviceMemory buffer_memory =
        engine.allocate(needs, VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT);
    CHECK(vkBindBufferMemory(engine.device, buffer, buffer_memory, 0));

    NeubrdfHost host{};
    host.size = sizeof host;
    host.get_instance_proc_addr = vkGetInstanceProcAddr;
    host.instance = engine.instance;
    host.physical_device = engine.physical;
    host.device = engine.device;
    host.ray_query = engine.ray_query;
    host.debug_utils = 1;
    Allocator allocator{engine, {}};
    VkPipelineCache cache = VK_NULL_HANDLE;
    if (is_made) {
        VkPipelineCacheCreateInfo cache_info{VK_STRUCTURE_TYPE_PIPELINE_CACHE_CREATE_INFO};
        CHECK(vkCreatePipelineCache(engine.device, &cache_info, nullptr, &cache));
        host.pipeline_cache = cache;
        host.allocate = allocate;
        host.free = release;
        host.user = &allocator;
    }
    NeubrdfContext* context;
    CHECK(neubrdf_context_create(&host, &context));
    NeubrdfScene* scene = nullptr;
    if (is_made) scene = make_scene(square, on_device, materials[0]);
    else CHECK(neubrdf_scene_load(file, &scene));
    CHECK(neubrdf_scene_set_film(scene, width / 2, height / 3));
    NeubrdfOptions options{};
    options.size = sizeof options;
    options.max_depth = 5;
    options.seed = 3;
    options.frames_in_flight = frames + 1;
    options.reserve = is_made ? NEUBRDF_RESERVE_NEUBRDF : 0;
    options.neubrdf_count = 2;
    options.traversal = on_device ? NEUBRDF_TRAVERSAL_RAY_QUERY : NEUBRDF_TRAVERSAL_AUTO;
    NeubrdfRenderer* renderer;
    CHECK(neubrdf_renderer_create(context, scene, &options, &renderer));
    neubrdf_scene_destroy(scene);
    CHECK(neubrdf_renderer_resize(renderer, width, height));

    // All frames are recorded and submitted before any is waited for.
    std::vector<VkCommandBuffer> commands(frames);
    VkCommandBufferAllocateInfo allocate{VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO};
    allocate.commandPool = engine.pool;
    allocate.commandBufferCount = frames;
    CHECK(vkAllocateCommandBuffers(engine.device, &allocate, commands.data()));
    VkFenceCreateInfo fence_info{VK_STRUCTURE_TYPE_FENCE_CREATE_INFO};
    VkFence fence;
    CHECK(vkCreateFence(engine.device, &fence_info, nullptr, &fence));
    // One comes to nothing, and what it was to upload, the next one uploads.
    uint64_t ticket = 0;
    VkCommandBufferBeginInfo begin{VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO};
    CHECK(vkBeginCommandBuffer(commands[0], &begin));
    CHECK(neubrdf_renderer_record_upload(renderer, commands[0], &ticket));
    CHECK(vkEndCommandBuffer(commands[0]));
    CHECK(neubrdf_renderer_abandon(renderer, ticket));
    if (neubrdf_renderer_abandon(renderer, ticket) != NEUBRDF_RESULT_INVALID_ARGUMENT) std::exit(1);
    CHECK(vkResetCommandPool(engine.device, engine.pool, 0));
    for (uint32_t i = 0; i < frames; ++i) {
        if (is_made && i == 1) change(renderer, square, on_device, materials);
        if (!is_made && i == 2) CHECK(neubrdf_renderer_reset(renderer));
        CHECK(vkBeginCommandBuffer(commands[i], &begin));
        NeubrdfTarget target{};
        target.size = sizeof target;
        target.format = NEUBRDF_FORMAT_RGBA32_FLOAT;
        target.image = image;
        target.layout_before = i == 0 ? VK_IMAGE_LAYOUT_UNDEFINED : VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL;
        target.layout_after = VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL;
        NeubrdfFrame frame{};
        frame.size = sizeof frame;
        frame.samples = 2;
        frame.targets = &target;
        frame.target_count = 1;
        frame.estimates_error = 1;
        if (i == 0) CHECK(neubrdf_renderer_record_upload(renderer, commands[i], &ticket));
        CHECK(neubrdf_renderer_record(renderer, commands[i], &frame, &ticket));
        if (i == 0) {
            const NeubrdfResult lost = neubrdf_renderer_device_lost(renderer);
            const bool says_where = std::strstr(neubrdf_last_error(), "nothing yet of recording 1") != nullptr;
            if (lost != NEUBRDF_RESULT_DEVICE_LOST || !says_where) std::exit(1);
        }
        if (i + 1 == frames) {
            VkBufferImageCopy region{};
            region.imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
            region.imageExtent = {width, height, 1};
            vkCmdCopyImageToBuffer(commands[i], image, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, buffer, 1, &region);
        }
        CHECK(vkEndCommandBuffer(commands[i]));
        VkSubmitInfo submit{VK_STRUCTURE_TYPE_SUBMIT_INFO};
        submit.commandBufferCount = 1;
        submit.pCommandBuffers = &commands[i];
        CHECK(vkQueueSubmit(engine.queue, 1, &submit, i + 1 == frames ? fence : VK_NULL_HANDLE));
    }
    uint32_t size[2], samples;
    CHECK(neubrdf_renderer_size(renderer, &size[0], &size[1], &samples));
    if (size[0] != width || size[1] != height || samples != (is_made ? 6 : 4)) std::exit(1);
    // One more would be too many.
    NeubrdfFrame one_more{};
    one_more.size = sizeof one_more;
    if (neubrdf_renderer_record(renderer, commands[0], &one_more, nullptr) != NEUBRDF_RESULT_FRAMES_IN_FLIGHT) std::exit(1);
    CHECK(vkWaitForFences(engine.device, 1, &fence, VK_TRUE, UINT64_MAX));
    NeubrdfStatus status{};
    status.size = sizeof status;
    CHECK(neubrdf_renderer_complete(renderer, ticket, &status));
    std::printf("%u samples, error %.4f, %u rejected\n", status.samples, status.error, status.rejected);

    write_pixels(engine, buffer_memory, bytes, output);
    if (is_made) {
        options.reserve = 0;
        renderer = renewed(context, renderer, options, on_device, materials);
        render_once(engine, renderer, buffer, bytes);
        write_pixels(engine, buffer_memory, bytes, std::string(output) + ".renewed");
    }

    neubrdf_renderer_destroy(renderer);
    neubrdf_context_destroy(context);
    vkDestroyPipelineCache(engine.device, cache, nullptr);
    std::printf("%d pieces of the engine's memory, %d left\n", allocator.given, allocator.alive);
    vkDestroyFence(engine.device, fence, nullptr);
    vkDestroyBuffer(engine.device, buffer, nullptr);
    vkFreeMemory(engine.device, buffer_memory, nullptr);
    vkDestroyImage(engine.device, image, nullptr);
    vkFreeMemory(engine.device, image_memory, nullptr);
}

int main(int argc, char** argv) {
    if (argc != 4 && argc != 7) {
        std::fprintf(stderr, "usage: host SCENE PIXELS DEVICE [MATERIAL OTHER THIRD]\n");
        return 2;
    }
    {
        Engine engine(argv[3]);
        render(engine, argv[1], argv[2], argv + 4);
    }
    std::printf("validation messages: %d\n", messages);
    return 0;
}
