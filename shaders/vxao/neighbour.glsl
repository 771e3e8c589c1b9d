// A pixel of another view as a piece of surface in this one's space. Expects the texel buffer `neighbours`, patch.glsl.
#include "lib/cheap.glsl"
#include "lib/neighbour.glsl"
#include "lib/surfel.glsl"

bool patches_of_neighbour(ivec2 p, int view, VxaoConstants c, out Patches patches) {
    uvec2 word = imageLoad(neighbours, (view * k.window.y + p.y) * k.window.x + p.x).xy;
    float z = uintBitsToFloat(word.x);
    if (!(z > 0.0)) return false;
    NeighbourPlace place = c.screen.places[view];
    vec3 ray = ray_there(vec2(p), place), n = vec3(bytes_of_normal(word.y));
    n *= inversesqrt(max(dot(n, n), 1.0));
    patches = patches_of(point_here(ray * z, place), turned_here(n, place), place.shift, ray, z, abs(dot(n, ray)), place.ray_step, c);
    return true;
}
