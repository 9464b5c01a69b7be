/* Images by Embree's packets of 16 rays, on the thread of the caller; for benches/peers.py, which builds this with
 * -DEMBREE=3 or 4. */

#include <math.h>
#include <string.h>

#if EMBREE == 4
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

/* A scene of one mesh in Embree's default quality, not yet committed; NULL when Embree refuses.
 *
 * vertices [vertex][3], triangles [triangle][3]; both are copied. */
RTCScene new_scene(RTCDevice device, const float *vertices, size_t num_vertices, const unsigned *triangles,
                   size_t num_triangles)
{
    RTCGeometry mesh = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    float *own_vertices = rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                                  3 * sizeof(float), num_vertices);
    unsigned *own_triangles = rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                                      3 * sizeof(unsigned), num_triangles);
    if (!own_vertices || !own_triangles) {
        rtcReleaseGeometry(mesh);
        return NULL;
    }
    memcpy(own_vertices, vertices, 3 * sizeof(float) * num_vertices);
    memcpy(own_triangles, triangles, 3 * sizeof(unsigned) * num_triangles);
    rtcCommitGeometry(mesh);

    RTCScene scene = rtcNewScene(device);
    rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_MEDIUM);
    rtcAttachGeometry(scene, mesh);
    rtcReleaseGeometry(mesh);
    return scene;
}

/* Distances [packet][16], infinite where nothing is hit, of rays from one origin.
 *
 * directions [packet][axis][16], unit vectors. */
void cast_packets(RTCScene scene, const float origin[3], const float *directions, size_t num_packets, float *distances)
{
    _Alignas(64) int valid[16];
    for (int lane = 0; lane < 16; ++lane)
        valid[lane] = -1;
#if EMBREE == 4
    struct RTCIntersectArguments arguments;
    rtcInitIntersectArguments(&arguments);
    arguments.flags = RTC_RAY_QUERY_FLAG_COHERENT;
#else
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
#endif

    struct RTCRayHit16 packet;
    memset(&packet, 0, sizeof packet);
    for (size_t i = 0; i < num_packets; ++i) {
        const float *direction = directions + 48 * i;
        for (int lane = 0; lane < 16; ++lane) {
            packet.ray.org_x[lane] = origin[0];
            packet.ray.org_y[lane] = origin[1];
            packet.ray.org_z[lane] = origin[2];
            packet.ray.dir_x[lane] = direction[lane];
            packet.ray.dir_y[lane] = direction[16 + lane];
            packet.ray.dir_z[lane] = direction[32 + lane];
            packet.ray.tfar[lane] = INFINITY;
            packet.ray.mask[lane] = -1;
            packet.hit.geomID[lane] = RTC_INVALID_GEOMETRY_ID;
        }
#if EMBREE == 4
        rtcIntersect16(valid, scene, &packet, &arguments);
#else
        rtcIntersect16(valid, scene, &context, &packet);
#endif
        memcpy(distances + 16 * i, packet.ray.tfar, sizeof packet.ray.tfar);
    }
}
