// The unit normal of a pixel, facing the camera; zero in holes. That of the plane fits where AO was computed from them,
// else from slopes of 1/z: from 1/z = n . ray / (n . point), the normal is parallel to
// (fx du, fy dv, 1/z - du (u - cx) - dv (v - cy)), du and dv being the slopes of 1/z. Included after clay.glsl by passes
// that declare `normals`, too.

layout(constant_id = spec_normals) const int has_normals = 0;

// A line through the pixel and its neighbours, least squares.
float slope(Line line) { return line.squares > 0.0 ? line.product / line.squares : 0.0; }

vec3 normal_of(ivec2 p, int at) {
    float w = inverse_at(at);
    if (w <= 0.0) return vec3(0.0);
    if (has_normals != 0) {
        vec3 fitted = vec3(imageLoad(normals, 3 * at).x, imageLoad(normals, 3 * at + 1).x, imageLoad(normals, 3 * at + 2).x);
        if (dot(fitted, fitted) > 0.0) return normalize(fitted);
    }
    float du = slope(along(p, ivec2(1, 0), w, 3)), dv = slope(along(p, ivec2(0, 1), w, 3));
    vec2 from_centre = vec2(p) - vec2(k.camera.cx, k.camera.cy), focal = vec2(k.camera.fx, k.camera.fy);
    vec3 away = vec3(focal * vec2(du, dv), w - du * from_centre.x - dv * from_centre.y);
    float squared = dot(away, away);
    return squared > 0.0 ? -away * inversesqrt(squared) : vec3(0.0);
}
