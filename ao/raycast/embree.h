// Embree 3 or 4: its device, one for this room, and casts written once for both. The device holds no geometry, only the
// choice of instructions.
#pragma once

#if EMBREE_MAJOR >= 4
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

namespace scanshade {

/// Throws Error where Embree cannot run.
[[nodiscard]] RTCDevice embree_device();

#if EMBREE_MAJOR >= 4

using EmbreeContext = RTCRayQueryContext;

inline void init(EmbreeContext& context) { rtcInitRayQueryContext(&context); }

inline RTCIntersectArguments intersect_arguments(EmbreeContext& context) {
    RTCIntersectArguments arguments;
    rtcInitIntersectArguments(&arguments);
    arguments.context = &context;
    return arguments;
}

inline RTCOccludedArguments occluded_arguments(EmbreeContext& context) {
    RTCOccludedArguments arguments;
    rtcInitOccludedArguments(&arguments);
    arguments.context = &context;
    return arguments;
}

inline void intersect(RTCScene scene, EmbreeContext& context, RTCRayHit& ray) {
    auto arguments = intersect_arguments(context);
    rtcIntersect1(scene, &ray, &arguments);
}

inline void intersect(const int* valid, RTCScene scene, EmbreeContext& context, RTCRayHit8& rays) {
    auto arguments = intersect_arguments(context);
    rtcIntersect8(valid, scene, &rays, &arguments);
}

inline void occluded(RTCScene scene, EmbreeContext& context, RTCRay& ray) {
    auto arguments = occluded_arguments(context);
    rtcOccluded1(scene, &ray, &arguments);
}

inline void occluded(const int* valid, RTCScene scene, EmbreeContext& context, RTCRay8& rays) {
    auto arguments = occluded_arguments(context);
    rtcOccluded8(valid, scene, &rays, &arguments);
}

#else

using EmbreeContext = RTCIntersectContext;

inline void init(EmbreeContext& context) { rtcInitIntersectContext(&context); }

inline void intersect(RTCScene scene, EmbreeContext& context, RTCRayHit& ray) { rtcIntersect1(scene, &context, &ray); }

inline void intersect(const int* valid, RTCScene scene, EmbreeContext& context, RTCRayHit8& rays) {
    rtcIntersect8(valid, scene, &context, &rays);
}

inline void occluded(RTCScene scene, EmbreeContext& context, RTCRay& ray) { rtcOccluded1(scene, &context, &ray); }

inline void occluded(const int* valid, RTCScene scene, EmbreeContext& context, RTCRay8& rays) {
    rtcOccluded8(valid, scene, &context, &rays);
}

#endif

} // namespace scanshade
