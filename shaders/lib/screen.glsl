// What every screen-space pass needs: the shared constants, addresses, points of pixels, sigma of depth.
#include "shared/screen.h"

// Every main() first copies the uniform block, before any branch: where lanes may be off, lavapipe loads each constant lane
// by lane; what main() loads first is loaded once.
ScreenConstants k;

int index_of(ivec2 p) { return p.y * k.size.x + p.x; }
bool inside(ivec2 p) { return all(lessThan(uvec2(p), uvec2(k.size))); }

// The ray through a pixel, z = 1; times depth it is the pixel's point.
vec3 ray_of(vec2 p) { return vec3(p * k.ray_step + k.ray_base, 1.0); }

float sigma_of(float z) { return k.noise_floor + k.noise_per_z2 * z * z; }

const uint not_a_number = 0x7fc00000u;

// The tone curve: visibility as shown.
float shown(float v) {
    if (k.curve > 0.0) v = exp(-k.curve * (1.0 - v));
    float v1 = clamp(1.0 - k.strength * (1.0 - v), 0.0, 1.0);
    return k.power == 1.0 ? v1 : pow(v1, k.power);
}
