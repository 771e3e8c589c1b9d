// The surface point of a pixel, the extent of its neighbourhood in the image, and the output. Expects the texel buffer
// `surfaces`, and the array `raw` to write.
#include "lib/cheap.glsl"

struct Surface {
    vec3 point, normal;
    vec2 ray;        // of its pixel, z = 1
    vec3 eye;        // unit, towards the camera
    float rise;      // lower above the tangent plane than this, in metres, nothing counts (with k.tangent_sine)
    float radius_px; // of the sphere around it, in the image
    float outline_sine, outline_cosine; // of the angle between its ray and the sphere's outline
};

// Any point in holes, where the result is discarded.
Surface surface_at(ivec2 p, float z, int index) {
    Surface s;
    vec3 ray = ray_of(vec2(p));
    z = z > 0.0 ? z : 1.0;
    s.point = ray * z;
    s.normal = normal_at(index);
    s.ray = ray.xy;
    float inverse = inversesqrt(dot(ray, ray));
    s.eye = -ray * inverse;
    s.outline_sine = min(k.radius * inverse / z, 0.999);
    s.outline_cosine = sqrt(1.0 - s.outline_sine * s.outline_sine);
    // Rounding of depth in single precision is a noise, too.
    s.rise = (k.tangent_sigmas * sigma_of(z) + 1e-6 * z) * abs(dot(s.normal, ray));
    s.radius_px = k.radius * sqrt(k.camera.fx * k.camera.fy) / z;
    return s;
}

// Whether a sample is on the surface or below it: pixels are next to the marched line, and depth is noisy. `apart` is the
// sample minus the point, `away` its length.
bool rises(Surface s, vec3 apart, float away) { return dot(s.normal, apart) > k.tangent_sine * away + s.rise; }

// acos for |c| <= 1 to 7e-5 (Abramowitz and Stegun 4.4.45).
float angle_of(float c) {
    float a = abs(c);
    float angle = sqrt(positive(1.0 - a)) * (((-0.0187293 * a + 0.0742610) * a - 0.2121144) * a + 1.5707288);
    return c < 0.0 ? 3.14159265 - angle : angle;
}

// A direction to march in the image, and how far.
struct March {
    vec2 direction; // unit, pixels
    float reach;    // pixels to the outline of the sphere around the point; large where that is beside or behind the camera
    float within;   // the part of it that lies in the image
};

// Nothing is known beyond the border: steps spread over the part inside.
March cut_at_border(vec2 p, vec2 direction, float reach) {
    vec2 room = mix(p + 0.49, vec2(k.size) - 0.51 - p, greaterThan(direction, vec2(0.0)));
    vec2 to_border = room / max(abs(direction), vec2(1e-6));
    return March(direction, reach, min(reach, min(to_border.x, to_border.y)));
}

// The pixel at this distance along a direction, clamped to the image: near the border it may be the pixel itself.
ivec2 pixel_along(vec2 p, March march, float pixels) {
    vec2 at = p + march.direction * min(pixels, march.within);
    return ivec2(nearest(at.x), nearest(at.y));
}

// Both ways along a direction d perpendicular to the eye's ray. The sphere's outline in the plane of eye and d is where the
// view ray touches it: at the angle asin(R / |P|) from the point's own ray. It covers what stands in front of the point, not
// only what is as deep.
void march_both_ways(Surface s, vec2 p, vec3 d, out March ahead, out March behind) {
    vec2 line = (d.xy - s.ray * d.z) / k.ray_step;
    float inverse = inversesqrt(max(dot(line, line), 1e-20));
    vec2 direction = line * inverse;
    vec2 end_z = vec2(d.z, -d.z) * s.outline_sine - s.eye.z * s.outline_cosine; // of the outline's unit rays
    vec2 reach = mix(vec2(1e6), s.outline_sine / (end_z * inverse), greaterThan(end_z, vec2(1e-4)));
    ahead = cut_at_border(p, direction, reach.x);
    behind = cut_at_border(p, -direction, reach.y);
}

// Writes a pixel's result. A radius below one pixel shows no occluders: open; up to three pixels the occlusion fades in.
void finish(Surface s, bool hole, int index, float visibility) {
    float occlusion = 1.0 - visibility;
    occlusion *= clamp(0.5 * s.radius_px - 0.5, 0.0, 1.0);
    raw[index] = hole ? 1.0 : clamp(1.0 - occlusion, 0.0, 1.0);
}
