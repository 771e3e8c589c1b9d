// All of CACAO's arithmetic that differs between devices: the same formulas, in a form fast on GPUs (FOR_GPU) and one fast on CPUs.
// The storage of depth differs, too: see scan/buffers and scan/images.
//
//   small, nearest_small    between floats and integers below 2^22
//   share(x)                max(x, 0) where x is at most 1
//   up_to_one(x)            min(x, 1) where x is positive
//   if_depth(z, value)      the value, or 0 where z is a hole
//   one_if_known(v)         1, or 0 where v is -1, a hole
//   quick_inversesqrt(x)    1 / (quick_scale sqrt(x)); the caller folds the scale into a constant
//   halo_weight(x)          0.6 clamp(2 + dz / R, 0, 1) + 0.4 of x = halo_scale dz / R (section 8.4)
#ifdef FOR_GPU

// Conversions run at an eighth of the rate of everything else, and 2^23 added to a float leaves the nearest integer in its low bits.
float small(uint n) { return uintBitsToFloat(0x4b000000u | n) - 8388608.0; }
vec3 small_less(uvec3 n, float less) { return uintBitsToFloat(0x4b000000u | n) - (8388608.0 + less); }
uint nearest_small(float x) { return floatBitsToUint(x + 8388608.0) & 0x7fffffu; }

// Clamping to [0, 1] costs nothing, and comparisons run at half the rate of everything else.
float share(float x) { return clamp(x, 0.0, 1.0); }
vec4 up_to_one(vec4 x) { return clamp(x, 0.0, 1.0); }
float if_depth(float z, float value) { return value * clamp(z * 1e30, 0.0, 1.0); }
float one_if_known(float value) { return clamp(value + 1.0, 0.0, 1.0); }

const float quick_scale = 1.0;
float quick_inversesqrt(float x) { return inversesqrt(x); }

const float halo_scale = 1.0;
float halo_weight(float scaled_dz) { return 0.6 * clamp(scaled_dz + 2.0, 0.0, 1.0) + 0.4; }

const bool branches_pay = true; // around work that few pixels need
const bool pairs_in_twos = true; // two pairs of taps are in flight at a time

#else
#include "lib/cheap.glsl"

float small(uint n) { return float(n); }
vec3 small_less(uvec3 n, float less) { return vec3(n) - less; }
uint nearest_small(float x) { return uint(roundEven(x)); }

float share(float x) { return positive(x); }
vec4 up_to_one(vec4 x) { return min(x, 1.0); }
float if_depth(float z, float value) { return z > 0.0 ? value : 0.0; }
float one_if_known(float value) { return value >= 0.0 ? 1.0 : 0.0; }

const float halo_scale = 0.6;
float halo_weight(float scaled_dz) { return at_most_one(at_least(scaled_dz + 1.6, 0.4)); }

const bool branches_pay = false; // lavapipe runs both sides
const bool pairs_in_twos = false;

#endif
vec4 small(uvec4 n) { return vec4(small(n.x), small(n.y), small(n.z), small(n.w)); }
