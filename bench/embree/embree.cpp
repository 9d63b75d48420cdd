// Embree on the mesh and rays that `cargo bench -p evolute --bench tracer -- --write FOLDER` wrote.
// g++ -O2 embree.cpp -lembree3 -o embree && ./embree FOLDER [ROUNDS]
#include <embree3/rtcore.h>
#include <time.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

template <class T> static std::vector<T> read(const std::string &path) {
    FILE *f = fopen(path.c_str(), "rb");
    if (!f) { fprintf(stderr, "%s cannot be read\n", path.c_str()); exit(1); }
    fseek(f, 0, SEEK_END);
    std::vector<T> data(ftell(f) / sizeof(T));
    rewind(f);
    if (fread(data.data(), sizeof(T), data.size(), f) != data.size()) exit(1);
    fclose(f);
    return data;
}

// Processor time of this thread [s].
static double now() {
    timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return t.tv_sec + 1e-9 * t.tv_nsec;
}

int main(int argc, char **argv) {
    const std::string folder = argc > 1 ? argv[1] : ".";
    const int rounds = argc > 2 ? atoi(argv[2]) : 3;
    const auto vertices = read<float>(folder + "/vertices.f32");
    const auto triangles = read<unsigned>(folder + "/triangles.u32");
    RTCDevice device = rtcNewDevice("threads=1");
    RTCScene scene = rtcNewScene(device);
    rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
    rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_HIGH);
    RTCGeometry g = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    memcpy(rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, vertices.size() / 3),
           vertices.data(), vertices.size() * 4);
    memcpy(rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, triangles.size() / 3),
           triangles.data(), triangles.size() * 4);
    rtcCommitGeometry(g);
    rtcAttachGeometry(scene, g);
    double start = now();
    rtcCommitScene(scene);
    printf("embree: built in %.2f s\n", now() - start);
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    for (const char *kind : {"nearest", "occluded", "coherent"}) {
        const auto rays = read<float>(folder + "/" + kind + ".f32");
        const size_t count = rays.size() / 6;
        const bool shadow = !strcmp(kind, "occluded");
        double best = 1e9;
        size_t hits = 0;
        for (int round = 0; round < rounds; round++) {
            start = now();
            hits = 0;
            for (size_t i = 0; i < count; i++) {
                const float *r = &rays[6 * i];
                RTCRayHit h;
                h.ray = RTCRay{r[0], r[1], r[2], 0, r[3], r[4], r[5], 0,
                               shadow ? 1.f : std::numeric_limits<float>::infinity(), ~0u, 0, 0};
                if (shadow) {
                    rtcOccluded1(scene, &context, &h.ray);
                    hits += h.ray.tfar < 0;
                } else {
                    h.hit.geomID = RTC_INVALID_GEOMETRY_ID;
                    rtcIntersect1(scene, &context, &h);
                    hits += h.hit.geomID != RTC_INVALID_GEOMETRY_ID;
                }
            }
            best = std::min(best, now() - start);
        }
        printf("embree: %-9s %6.2f Mray/s (%.1f %% hit)\n", kind, count / best / 1e6, 100.0 * hits / count);
    }
}
