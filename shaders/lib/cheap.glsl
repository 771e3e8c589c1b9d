// Operations of one instruction where the built-in ones take several: conversions run at a quarter of the rate on GPUs, and
// min/max must handle NaN on lavapipe. All need |x| < 2^22.

const float magic = 12582912.0; // 1.5 * 2^23: adding it leaves the nearest integer in the low mantissa bits
const int magic_bits = 0x4b400000;

int nearest(float x) {
    precise float shifted = x + magic;
    return floatBitsToInt(shifted) - magic_bits;
}
ivec4 nearest(vec4 x) {
    precise vec4 shifted = x + magic;
    return floatBitsToInt(shifted) - magic_bits;
}
float positive(float x) { return intBitsToFloat(max(floatBitsToInt(x), 0)); }               // max(x, 0)
float at_most_one(float x) { return intBitsToFloat(min(floatBitsToInt(x), 0x3f800000)); }   // min(x, 1), x >= 0
float at_least(float x, float low) { return intBitsToFloat(max(floatBitsToInt(x), floatBitsToInt(low))); } // low > 0

// 1 / (quick_scale sqrt(x)) to 0.07 %: half the exponent, then one Newton step with Kadlec's constants. A square root and a
// division take 20 cycles on CPUs; the scale is for the caller to fold into something constant.
const float quick_scale = 0.703952253;
float quick_inversesqrt(float x) {
    float y = intBitsToFloat(0x5f1ffff9 - (floatBitsToInt(x) >> 1));
    return y * (2.38924456 - x * y * y);
}
vec4 positive(vec4 x) { return intBitsToFloat(max(floatBitsToInt(x), ivec4(0))); }
vec4 quick_inversesqrt(vec4 x) {
    vec4 y = intBitsToFloat(0x5f1ffff9 - (floatBitsToInt(x) >> 1));
    return y * (2.38924456 - x * y * y);
}
