// Light of a photograph, split into an ambient and a direct part (ao/finish/light.h).
#ifndef SCANSHADE_SHARED_LIGHT_H
#define SCANSHADE_SHARED_LIGHT_H
#include "camera.h"
#include "types.h"
SHARED_BEGIN

// In camera space.
struct LightConstants {
    vec3 direct; // towards the light; its length is direct / ambient light, of a surface that faces it
};

// Positions tried towards the light, the first ones closer together.
const int shadow_steps = 32;
const float shadow_thickness =
    0.4f; // metres: what the camera sees in front of a ray by more than this is not in its way

// Along the ray towards the light, metres. (GLSL's and C++'s constant expressions share no float but a local one.)
SHARED_FN float shadow_step(int i) {
    const float reach = 2;
    return reach * float(i + 1) * float(i + 1) / float(shadow_steps * shadow_steps);
}
// What a surface at depth z has to be lifted, and what it takes to be in the way of a ray at that depth.
SHARED_FN float shadow_bias(float z) { return 0.01f * (1 + z); }

SHARED_FN float dotted(vec3 a, vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
SHARED_FN float larger_of(float a, float b) { return a > b ? a : b; }

// Direct light over ambient light that reaches a surface of that visibility.
SHARED_FN float direct_over_ambient(LightConstants light, vec3 normal, float visible, float lit) {
    const float least_ambient = 0.05f; // there is no less anywhere: bounces, which no model has
    return lit * larger_of(dotted(light.direct, normal), 0) / larger_of(visible, least_ambient);
}

// The share of ambient light, of direct_over_ambient().
SHARED_FN float ambient_share(float ratio) { return 1 / (1 + ratio); }

// Visibility that colour may be divided by. Where confidence is below a half, it nears 1, so that nothing is blown up.
SHARED_FN float divisor(float visible, float confidence) {
    const float confident = 0.5f, least_divisor = 0.15f;
    float sure = confidence > confident ? 1 : confidence > 0 ? confidence / confident : 0; // 0 for NaN
    return larger_of(1 - sure * (1 - visible), least_divisor);
}

SHARED_END
#endif
