// The pixel of a point in space, and the depth there: for methods that test points around the surface.

struct Seen {
    bool known;
    vec3 point; // of the pixel's centre
    float z;
};

Seen seen_at(vec3 q) {
    float inverse = 1.0 / max(q.z, 1e-6);
    vec2 at = vec2(k.camera.fx, k.camera.fy) * q.xy * inverse + vec2(k.camera.cx, k.camera.cy);
    at = mix(vec2(-2.0), at, lessThan(abs(at), vec2(1e6))); // far outside is outside
    ivec2 pixel = ivec2(nearest(at.x), nearest(at.y));
    bool in_view = inside(pixel) && q.z > 1e-4;
    float z = imageLoad(depth_in, in_view ? index_of(pixel) : 0).x;
    Seen seen;
    seen.known = in_view && z > 0.0;
    seen.z = z;
    seen.point = ray_of(vec2(pixel)) * z;
    return seen;
}
