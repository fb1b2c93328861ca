/* Embree's side of tests/bench/rays.py: loads the library that the embreex wheel carries and traces arrays of
   rays with rtcIntersect1 / rtcOccluded1, one thread. The few declarations needed follow Embree 4's API. */
#include <dlfcn.h>
#include <immintrin.h>
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <sys/types.h>

typedef void* Handle;
struct __attribute__((aligned(16))) RayHit {
    float org[3], tnear, dir[3], time, tfar;
    unsigned mask, id, flags;
    float normal[3], u, v;
    unsigned prim, geometry, instance[4];
};
enum { TRIANGLES = 0, INDEX = 0, VERTEX = 1, UINT3 = 0x5003, FLOAT3 = 0x9003, ROBUST = 4, HIGH = 2, ALL = -1 };

static Handle (*new_device)(const char*), (*new_scene)(Handle), (*new_geometry)(Handle, int);
static void (*shared_buffer)(Handle, int, unsigned, int, const void*, size_t, size_t, size_t);
static void (*commit_geometry)(Handle), (*commit_scene)(Handle), (*release_scene)(Handle);
static unsigned (*attach)(Handle, Handle);
static void (*scene_flags)(Handle, int), (*scene_quality)(Handle, int);
static void (*monitor)(Handle, int (*)(void*, ssize_t, int), void*);
static void (*intersect1)(Handle, struct RayHit*, void*), (*occluded1)(Handle, struct RayHit*, void*);
static ssize_t allocated;

static int count_bytes(void* context, ssize_t bytes, int post) {
    (void)context;
    (void)post;
    allocated += bytes;
    return 1;
}

int embree_load(const char* path) {
    void* library = dlopen(path, RTLD_NOW);
    if (!library) {
        fprintf(stderr, "%s\n", dlerror());
        return 0;
    }
    *(void**)&new_device = dlsym(library, "rtcNewDevice");
    *(void**)&new_scene = dlsym(library, "rtcNewScene");
    *(void**)&new_geometry = dlsym(library, "rtcNewGeometry");
    *(void**)&shared_buffer = dlsym(library, "rtcSetSharedGeometryBuffer");
    *(void**)&commit_geometry = dlsym(library, "rtcCommitGeometry");
    *(void**)&commit_scene = dlsym(library, "rtcCommitScene");
    *(void**)&release_scene = dlsym(library, "rtcReleaseScene");
    *(void**)&attach = dlsym(library, "rtcAttachGeometry");
    *(void**)&scene_flags = dlsym(library, "rtcSetSceneFlags");
    *(void**)&scene_quality = dlsym(library, "rtcSetSceneBuildQuality");
    *(void**)&monitor = dlsym(library, "rtcSetDeviceMemoryMonitorFunction");
    *(void**)&intersect1 = dlsym(library, "rtcIntersect1");
    *(void**)&occluded1 = dlsym(library, "rtcOccluded1");
    return intersect1 && occluded1 && monitor && scene_quality && scene_flags && attach && commit_scene;
}

Handle embree_device(const char* config) {
    Handle device = new_device(config);
    monitor(device, count_bytes, NULL);
    return device;
}

Handle embree_build(Handle device, const float* positions, size_t vertices, const unsigned* triangles, size_t count,
                    int robust, int high) {
    Handle scene = new_scene(device);
    if (robust) scene_flags(scene, ROBUST);
    if (high) scene_quality(scene, HIGH);
    Handle geometry = new_geometry(device, TRIANGLES);
    shared_buffer(geometry, VERTEX, 0, FLOAT3, positions, 0, 12, vertices);
    shared_buffer(geometry, INDEX, 0, UINT3, triangles, 0, 12, count);
    commit_geometry(geometry);
    attach(scene, geometry);
    commit_scene(scene);
    return scene;
}

long long embree_bytes(void) { return (long long)allocated; }
void embree_release(Handle scene) { release_scene(scene); }

static void set(struct RayHit* r, const float* ray) {
    for (int i = 0; i < 3; ++i) {
        r->org[i] = ray[i];
        r->dir[i] = ray[4 + i];
    }
    r->tnear = ray[3];
    r->tfar = ray[7];
    r->time = 0.0f;
    r->mask = (unsigned)ALL;
    r->id = r->flags = 0;
    r->geometry = r->prim = r->instance[0] = (unsigned)ALL;
}

void embree_closest(Handle scene, const float* rays, size_t count, float* t, int* prim, float* u, float* v) {
    unsigned control = _mm_getcsr();
    _mm_setcsr(control | 0x8040); /* flush denormals, as Embree asks its users to */
    for (size_t i = 0; i < count; ++i) {
        struct RayHit r;
        set(&r, rays + 8 * i);
        intersect1(scene, &r, NULL);
        prim[i] = (int)r.prim;
        t[i] = prim[i] < 0 ? INFINITY : r.tfar;
        u[i] = r.u;
        v[i] = r.v;
    }
    _mm_setcsr(control);
}

void embree_any(Handle scene, const float* rays, size_t count, unsigned char* blocked) {
    unsigned control = _mm_getcsr();
    _mm_setcsr(control | 0x8040);
    for (size_t i = 0; i < count; ++i) {
        struct RayHit r;
        set(&r, rays + 8 * i);
        occluded1(scene, &r, NULL);
        blocked[i] = r.tfar < 0.0f;
    }
    _mm_setcsr(control);
}
