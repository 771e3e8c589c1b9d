// One texel of a depth mip from four of the mip below.

// Mean of what lies on the nearest surface. Scan leaves holes out and yields a hole when all four are.
float nearest_surface(float a, float b, float c, float d) {
    vec4 z = vec4(a, b, c, d);
    vec4 known = scan != 0 ? vec4(greaterThan(z, vec4(0.0))) : vec4(1.0);
    float nearest = min(min(a, b), min(c, d));
    if (scan != 0) { // as unsigned integers less one, holes are the farthest; a far stand-in for them came out as 0 on NVIDIA
        uvec4 order = floatBitsToUint(z) - 1u;
        nearest = uintBitsToFloat(min(min(order.x, order.y), min(order.z, order.w)) + 1u);
    }
    vec4 away = z - nearest;
    vec4 w = known * clamp(1.0 + k.mip_weight * (away * away), 0.0, 1.0);
    float total = w.x + w.y + w.z + w.w;
    if (scan != 0 && total == 0.0) return 0.0;
    return (w.x * a + w.y * b + w.z * c + w.w * d) / total;
}
