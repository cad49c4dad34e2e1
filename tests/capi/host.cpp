// A small engine in C++: its own instance, device, queue, command buffer and image, under synchronization validation. It renders an
// OBJ file into its image, a few frames in flight, and writes the pixels to a file.
//
//   host SCENE PIXELS DEVICE
#include "neubrdf.h"

#include <vulkan/vulkan.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>
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
    VkDeviceMemory allocate(const VkMemoryRequirements& needs, VkMemoryPropertyFlags flags) const;
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
    CHECK(neubrdf_requirements_merge(requirements, 1, &device_info));
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

VkDeviceMemory Engine::allocate(const VkMemoryRequirements& needs, VkMemoryPropertyFlags flags) const {
    VkMemoryAllocateInfo info{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO};
    info.allocationSize = needs.size;
    info.memoryTypeIndex = memory_type(needs.memoryTypeBits, flags);
    VkDeviceMemory memory;
    CHECK(vkAllocateMemory(device, &info, nullptr, &memory));
    return memory;
}

static void render(const Engine& engine, const char* file, const char* output) {
    const uint32_t width = 64, height = 48, frames = 4;
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
    NeubrdfContext* context;
    CHECK(neubrdf_context_create(&host, &context));
    NeubrdfScene* scene;
    CHECK(neubrdf_scene_load(file, &scene));
    CHECK(neubrdf_scene_set_film(scene, width, height));
    NeubrdfOptions options{};
    options.size = sizeof options;
    options.max_depth = 5;
    options.seed = 3;
    options.frames_in_flight = frames;
    NeubrdfRenderer* renderer;
    CHECK(neubrdf_renderer_create(context, scene, &options, &renderer));
    neubrdf_scene_destroy(scene);

    // All frames are recorded and submitted before any is waited for.
    std::vector<VkCommandBuffer> commands(frames);
    VkCommandBufferAllocateInfo allocate{VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO};
    allocate.commandPool = engine.pool;
    allocate.commandBufferCount = frames;
    CHECK(vkAllocateCommandBuffers(engine.device, &allocate, commands.data()));
    VkFenceCreateInfo fence_info{VK_STRUCTURE_TYPE_FENCE_CREATE_INFO};
    VkFence fence;
    CHECK(vkCreateFence(engine.device, &fence_info, nullptr, &fence));
    uint64_t ticket = 0;
    for (uint32_t i = 0; i < frames; ++i) {
        VkCommandBufferBeginInfo begin{VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO};
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
        CHECK(neubrdf_renderer_record(renderer, commands[i], &frame, &ticket));
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
    // One more would be too many.
    if (neubrdf_renderer_record(renderer, commands[0], nullptr, nullptr) != NEUBRDF_RESULT_INVALID_ARGUMENT) std::exit(1);
    CHECK(vkWaitForFences(engine.device, 1, &fence, VK_TRUE, UINT64_MAX));
    NeubrdfStatus status{};
    status.size = sizeof status;
    CHECK(neubrdf_renderer_complete(renderer, ticket, &status));
    std::printf("%u samples, error %.4f, %u rejected\n", status.samples, status.error, status.rejected);

    void* pixels;
    CHECK(vkMapMemory(engine.device, buffer_memory, 0, bytes, 0, &pixels));
    std::FILE* out = std::fopen(output, "wb");
    if (!out || std::fwrite(pixels, 1, bytes, out) != bytes || std::fclose(out) != 0) std::exit(1);

    neubrdf_renderer_destroy(renderer);
    neubrdf_context_destroy(context);
    vkDestroyFence(engine.device, fence, nullptr);
    vkDestroyBuffer(engine.device, buffer, nullptr);
    vkFreeMemory(engine.device, buffer_memory, nullptr);
    vkDestroyImage(engine.device, image, nullptr);
    vkFreeMemory(engine.device, image_memory, nullptr);
}

int main(int argc, char** argv) {
    if (argc != 4) {
        std::fprintf(stderr, "usage: host SCENE PIXELS DEVICE\n");
        return 2;
    }
    {
        Engine engine(argv[3]);
        render(engine, argv[1], argv[2]);
    }
    std::printf("validation messages: %d\n", messages);
    return 0;
}
