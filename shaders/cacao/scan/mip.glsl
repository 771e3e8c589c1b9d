// One texel of a depth mip from four of the mip below (section 8.2, avg*): the mean depth of the nearest surface. Holes are left
// out; four holes make a hole.
float nearest_surface(float a, float b, float c, float d) {
    vec4 z = vec4(a, b, c, d);
    vec4 known = vec4(greaterThan(z, vec4(0.0)));
    uvec4 order = floatBitsToUint(z) - 1u; // so that holes sort last; a large substitute depth came out as 0 on NVIDIA
    float nearest = uintBitsToFloat(min(min(order.x, order.y), min(order.z, order.w)) + 1u);
    vec4 away = z - nearest;
    vec4 w = known * clamp(1.0 + k.mip_weight * (away * away), 0.0, 1.0);
    float total = w.x + w.y + w.z + w.w;
    if (total == 0.0) return 0.0;
    return (w.x * a + w.y * b + w.z * c + w.w * d) / total;
}
