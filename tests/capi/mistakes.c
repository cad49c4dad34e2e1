/* What goes wrong in C comes back as a result with words, and never as a crash.
 *
 *   mistakes FILE      a file that is no scene
 */
#include "neubrdf.h"

#include <stdio.h>
#include <string.h>

static int failures = 0;

static void expect(NeubrdfResult found, NeubrdfResult expected, const char *words, const char *call) {
    const char *said = neubrdf_last_error();
    if (found == expected && (found == NEUBRDF_RESULT_OK || strstr(said, words))) return;
    failures += 1;
    printf("%s returned %d, not %d, and said: %s\n", call, found, expected, said);
}

#define EXPECT(call, expected, words) expect(call, expected, words, #call)

static void scenes(const char *file) {
    NeubrdfScene *scene = NULL;
    EXPECT(neubrdf_scene_load(NULL, &scene), NEUBRDF_RESULT_INVALID_ARGUMENT, "path");
    EXPECT(neubrdf_scene_load("/nowhere.obj", &scene), NEUBRDF_RESULT_SCENE, "/nowhere.obj");
    EXPECT(neubrdf_scene_load("\xff", &scene), NEUBRDF_RESULT_INVALID_ARGUMENT, "UTF-8");
    EXPECT(neubrdf_scene_load(file, &scene), NEUBRDF_RESULT_SCENE, "unknown key");
    EXPECT(neubrdf_scene_create(NULL), NEUBRDF_RESULT_INVALID_ARGUMENT, "null");

    EXPECT(neubrdf_scene_create(&scene), NEUBRDF_RESULT_OK, "");
    EXPECT(neubrdf_scene_set_film(scene, 0, 1), NEUBRDF_RESULT_INVALID_ARGUMENT, "0x1");
    NeubrdfCamera camera;
    memset(&camera, 0, sizeof camera);
    EXPECT(neubrdf_scene_set_camera(scene, &camera), NEUBRDF_RESULT_INVALID_ARGUMENT, "sizeof(NeubrdfCamera)");
    camera.size = sizeof camera;
    EXPECT(neubrdf_scene_set_camera(scene, &camera), NEUBRDF_RESULT_SCENE, "target");
    EXPECT(neubrdf_scene_add_instance(scene, 7, NULL, NULL), NEUBRDF_RESULT_SCENE, "mesh of instance 0");
    NeubrdfMaterial material;
    memset(&material, 0, sizeof material);
    material.size = sizeof material;
    material.surface = 99;
    EXPECT(neubrdf_scene_add_material(scene, &material, NULL), NEUBRDF_RESULT_INVALID_ARGUMENT, "surface is 99");
    material.surface = NEUBRDF_SURFACE_OF_MATERIAL;
    EXPECT(neubrdf_scene_add_material(scene, &material, NULL), NEUBRDF_RESULT_INVALID_ARGUMENT, "surface_of is 0, of 0");
    struct { NeubrdfMaterial known; uint32_t unknown; } newer;
    memset(&newer, 0, sizeof newer);
    newer.known.size = sizeof newer;
    newer.unknown = 1;
    EXPECT(neubrdf_scene_add_material(scene, &newer.known, NULL), NEUBRDF_RESULT_INVALID_ARGUMENT, "newer library");
    material.surface = NEUBRDF_SURFACE_DIFFUSE;
    uint32_t index = 9;
    EXPECT(neubrdf_scene_add_material(scene, &material, &index), NEUBRDF_RESULT_OK, "");
    if (index != 0) failures += 1;
    NeubrdfMesh mesh;
    memset(&mesh, 0, sizeof mesh);
    mesh.size = sizeof mesh;
    mesh.vertex_count = 3;
    EXPECT(neubrdf_scene_add_mesh(scene, &mesh, NULL), NEUBRDF_RESULT_INVALID_ARGUMENT, "positions");
    NeubrdfDeviceMesh device_mesh;
    memset(&device_mesh, 0, sizeof device_mesh);
    EXPECT(neubrdf_scene_add_device_mesh(scene, &device_mesh, NULL, NULL), NEUBRDF_RESULT_INVALID_ARGUMENT, "sizeof");
    device_mesh.size = sizeof device_mesh;
    EXPECT(neubrdf_scene_add_device_mesh(scene, &device_mesh, NULL, NULL), NEUBRDF_RESULT_INVALID_ARGUMENT, "indices is 0");
    device_mesh.indices = 256;
    device_mesh.index_type = VK_INDEX_TYPE_UINT16;
    EXPECT(neubrdf_scene_add_device_mesh(scene, &device_mesh, NULL, NULL), NEUBRDF_RESULT_INVALID_ARGUMENT, "positions is 0");
    device_mesh.index_type = VK_INDEX_TYPE_NONE_KHR;
    EXPECT(neubrdf_scene_add_device_mesh(scene, &device_mesh, NULL, NULL), NEUBRDF_RESULT_INVALID_ARGUMENT, "index_type");
    EXPECT(neubrdf_scene_add_texture(scene, 0, 4, NULL, NULL), NEUBRDF_RESULT_INVALID_ARGUMENT, "0x4");
    const float scale[2] = {1, 1};
    EXPECT(neubrdf_scene_place_texture(scene, 7, scale, scale), NEUBRDF_RESULT_INVALID_ARGUMENT, "texture 7 of");
    EXPECT(neubrdf_scene_place_texture(scene, 0, scale, NULL), NEUBRDF_RESULT_INVALID_ARGUMENT, "offset");
    EXPECT(neubrdf_scene_add_material_file(scene, "/nowhere.neubrdf", NULL, NULL), NEUBRDF_RESULT_SCENE, "/nowhere");
    EXPECT(neubrdf_scene_set_material(scene, 7, &material), NEUBRDF_RESULT_SCENE, "index of a material");
    EXPECT(neubrdf_scene_set_material_file(scene, 0, "/nowhere.neubrdf", NULL), NEUBRDF_RESULT_SCENE, "/nowhere");
    EXPECT(neubrdf_scene_set_instances(scene, NULL, NULL, 0), NEUBRDF_RESULT_SCENE, "number of instances");
    const uint32_t instance = 7;
    const float rows[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
    EXPECT(neubrdf_scene_set_transforms(scene, &instance, rows, 1), NEUBRDF_RESULT_SCENE, "instance");
    EXPECT(neubrdf_scene_deform(scene, 7, NULL), NEUBRDF_RESULT_INVALID_ARGUMENT, "NeubrdfDeformation");
    const float down[3] = {0, 0, 0};
    EXPECT(neubrdf_scene_set_sun(scene, down, down), NEUBRDF_RESULT_INVALID_ARGUMENT, "direction");
    const float nan = 0.0f / 0.0f;
    const float sky[3] = {nan, 0, 0};
    EXPECT(neubrdf_scene_set_environment(scene, 1, 1, sky, 0), NEUBRDF_RESULT_SCENE, "");
    if (neubrdf_scene_warning(scene, 0)) failures += 1;
    neubrdf_scene_destroy(scene);
    neubrdf_scene_destroy(NULL);
}

/* Bytes of whatever kind are no crash. */
static void bytes(void) {
    const char junk[64] = "NEUBRDF\0\2\0\0\0\377\377\377\377";
    NeubrdfScene *scene = NULL;
    uint32_t index = 9;
    EXPECT(neubrdf_scene_create(&scene), NEUBRDF_RESULT_OK, "");
    EXPECT(neubrdf_scene_add_material_memory(scene, NULL, 8, NULL, NULL, &index), NEUBRDF_RESULT_INVALID_ARGUMENT, "bytes: 8");
    EXPECT(neubrdf_scene_add_material_memory(scene, junk, UINT64_MAX, NULL, NULL, &index), NEUBRDF_RESULT_INVALID_ARGUMENT, "bytes");
    EXPECT(neubrdf_scene_add_material_memory(scene, NULL, 0, NULL, NULL, &index), NEUBRDF_RESULT_SCENE, "cut off");
    EXPECT(neubrdf_scene_add_material_memory(scene, junk, sizeof junk, NULL, "of the pack", &index), NEUBRDF_RESULT_SCENE, "of the pack: checksum");
    EXPECT(neubrdf_scene_add_material_memory(scene, junk + 1, 63, NULL, "\xff", &index), NEUBRDF_RESULT_INVALID_ARGUMENT, "label");
    EXPECT(neubrdf_scene_add_material_memory(scene, junk + 1, 63, NULL, NULL, &index), NEUBRDF_RESULT_SCENE, "in memory");
    EXPECT(neubrdf_scene_set_material_memory(scene, 0, junk + 1, 63, NULL, NULL), NEUBRDF_RESULT_SCENE, "in memory");
    if (index != 9) failures += 1;
    neubrdf_scene_destroy(scene);
}

static void give_back(void *user, const NeubrdfMemory *memory) {
    (void)user, (void)memory;
}

static void devices(void) {
    NeubrdfHost host;
    memset(&host, 0, sizeof host);
    NeubrdfContext *context = NULL;
    EXPECT(neubrdf_context_create(NULL, &context), NEUBRDF_RESULT_INVALID_ARGUMENT, "NeubrdfHost");
    host.size = sizeof host;
    EXPECT(neubrdf_context_create(&host, &context), NEUBRDF_RESULT_INVALID_ARGUMENT, "get_instance_proc_addr");
    host.get_instance_proc_addr = vkGetInstanceProcAddr;
    host.free = give_back;
    EXPECT(neubrdf_context_create(&host, &context), NEUBRDF_RESULT_INVALID_ARGUMENT, "free without .allocate");
    EXPECT(neubrdf_renderer_create(NULL, NULL, NULL, NULL), NEUBRDF_RESULT_INVALID_ARGUMENT, "context is null");
    EXPECT(neubrdf_renderer_record(NULL, NULL, NULL, NULL), NEUBRDF_RESULT_INVALID_ARGUMENT, "renderer is null");
    EXPECT(neubrdf_renderer_complete(NULL, 0, NULL), NEUBRDF_RESULT_INVALID_ARGUMENT, "renderer is null");
    EXPECT(neubrdf_renderer_abandon(NULL, 1), NEUBRDF_RESULT_INVALID_ARGUMENT, "renderer is null");
    EXPECT(neubrdf_renderer_set_instances(NULL, NULL, NULL, 1), NEUBRDF_RESULT_INVALID_ARGUMENT, "object_to_world");
    EXPECT(neubrdf_renderer_set_top_level(NULL, 0), NEUBRDF_RESULT_INVALID_ARGUMENT, "renderer is null");
    EXPECT(neubrdf_renderer_deform(NULL, 0, NULL), NEUBRDF_RESULT_INVALID_ARGUMENT, "NeubrdfDeformation");
    NeubrdfDeformation deformation;
    memset(&deformation, 0, sizeof deformation);
    deformation.size = sizeof deformation;
    deformation.reserved = 1;
    EXPECT(neubrdf_renderer_deform(NULL, 0, &deformation), NEUBRDF_RESULT_INVALID_ARGUMENT, "reserved is 1");
    EXPECT(neubrdf_renderer_set_material_file(NULL, 0, "", NULL), NEUBRDF_RESULT_INVALID_ARGUMENT, "renderer is null");
    EXPECT(neubrdf_renderer_set_material_memory(NULL, 0, "", 0, NULL, NULL), NEUBRDF_RESULT_INVALID_ARGUMENT, "renderer is null");
    NeubrdfScene *scene = NULL;
    EXPECT(neubrdf_renderer_scene(NULL, &scene), NEUBRDF_RESULT_INVALID_ARGUMENT, "renderer is null");
    neubrdf_renderer_destroy(NULL);
    neubrdf_context_destroy(NULL);
}

int main(int argc, char **argv) {
    if (argc != 2) return 2;
    if (neubrdf_version() < 1000) failures += 1;
    scenes(argv[1]);
    bytes();
    devices();
    printf(failures ? "%d mistakes\n" : "all is as expected\n", failures);
    return failures != 0;
}
