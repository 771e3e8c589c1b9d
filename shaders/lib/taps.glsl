// Taps of the classic methods: single pixels of the disc that a radius covers in the image. Expects the texel buffer
// `depth_in`; lib/surface.glsl comes first.

struct Tap {
    bool known;    // in the image, and not in a hole
    bool counts;   // known, within the radius, and above the surface by more than its own noise: rule (2)
    vec3 apart;    // from the surface point, metres
    float away2;   // its length squared
    float inverse; // 1 / length
};

// What lies at this distance from the surface point of `s`.
Tap tap_of(Surface s, bool known, vec3 point) {
    Tap t;
    t.known = known;
    t.apart = point - s.point;
    t.away2 = dot(t.apart, t.apart) + 1e-20;
    t.inverse = inversesqrt(t.away2);
    t.counts = known && t.away2 <= k.radius * k.radius && rises(s, t.apart, t.away2 * t.inverse);
    return t;
}

// Outside the image nothing is known: the border's pixel is not repeated.
Tap tap_at(Surface s, ivec2 q) {
    bool seen = inside(q);
    float z = imageLoad(depth_in, seen ? index_of(q) : 0).x;
    return tap_of(s, seen && z > 0.0, ray_of(vec2(q)) * z);
}

// Pixels of the radius along both axes: of the circle parallel to the image. Pixels need not be square.
vec2 disc_px(Surface s) { return vec2(k.camera.fx, k.camera.fy) * (k.radius / s.point.z); }

// The pixel at a share of the radius along a unit direction, never the surface's own.
ivec2 pixel_of_disc(ivec2 p, vec2 radii_px, vec2 direction, float share) {
    vec2 offset = radii_px * direction * share;
    float length2 = dot(offset, offset);
    offset *= length2 < 1.0 ? inversesqrt(max(length2, 1e-20)) : 1.0;
    offset = clamp(offset, vec2(-1e6), vec2(1e6));
    return p + ivec2(nearest(offset.x), nearest(offset.y));
}

vec2 turned_by(vec2 direction, float cosine, float sine) {
    return vec2(direction.x * cosine - direction.y * sine, direction.y * cosine + direction.x * sine);
}
