// Float and integer steps that cost one instruction where the built-in ones cost several: conversions run at a quarter of
// the rate on GPUs, and min/max must mind NaN on lavapipe. All need |x| < 2^22.

const float magic = 12582912.0; // 1.5 * 2^23: adding it leaves the nearest integer in the low mantissa bits
const int magic_bits = 0x4b400000;

int nearest(float x) {
    precise float shifted = x + magic;
    return floatBitsToInt(shifted) - magic_bits;
}
ivec2 nearest(vec2 x) {
    precise vec2 shifted = x + magic;
    return floatBitsToInt(shifted) - magic_bits;
}
vec2 float_of(ivec2 i) {
    precise vec2 shifted = intBitsToFloat(i + magic_bits);
    return shifted - magic;
}
float power_of_two(int e) { return intBitsToFloat((e + 127) << 23); }
float positive(float x) { return intBitsToFloat(max(floatBitsToInt(x), 0)); }               // max(x, 0)
float at_most_one(float x) { return intBitsToFloat(min(floatBitsToInt(x), 0x3f800000)); }   // min(x, 1), x >= 0
