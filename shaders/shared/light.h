// Light of a photograph, split into an ambient and a direct part: one text for the estimate on the host and for the
// pictures on the device. ao/light/README.md has the model.
#ifndef SCANSHADE_SHARED_LIGHT_H
#define SCANSHADE_SHARED_LIGHT_H
#include "camera.h"
#include "types.h"
SHARED_BEGIN

// In camera space.
struct LightConstants {
    vec3 direct;   // towards the light; its length is direct / ambient light, of a surface that faces it
    vec3 tint;     // of direct over ambient light, in red, green and blue; 1 in luminance
    vec3 gradient; // ambient light from there is 1 + gradient . normal
    float power;   // of visibility in the photograph
    int shadows;   // 1 = the depth image casts shadows
};

// Positions tried towards the light, the first ones closer together.
const int shadow_steps = 32;
const float shadow_reach = 2;    // metres
const float shadow_lift = 0.01f; // of depth, and as many metres: what rays begin above their surface
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

// Direct light over ambient light that reaches an open surface: `visible` is visibility to the light's power.
SHARED_FN float direct_over_ambient(LightConstants light, vec3 normal, float visible, float lit) {
    const float least_ambient = 0.05f; // there is no less anywhere: bounces, which no model has
    float ambient = larger_of(visible, least_ambient) * larger_of(1 + dotted(light.gradient, normal), least_ambient);
    return lit * larger_of(dotted(light.direct, normal), 0) / ambient;
}

// A share of ambient light in one channel, of direct_over_ambient() and that channel's tint.
SHARED_FN float ambient_share(float ratio, float tint) { return 1 / (1 + ratio * tint); }

// Visibility that colour may be divided by. Where confidence is below a half, it nears 1, so that nothing is blown up.
SHARED_FN float divisor(float visible, float confidence) {
    const float confident = 0.5f, least_divisor = 0.15f;
    float sure = confidence > confident ? 1 : confidence > 0 ? confidence / confident : 0; // 0 for NaN
    return larger_of(1 - sure * (1 - visible), least_divisor);
}

SHARED_END
#endif
