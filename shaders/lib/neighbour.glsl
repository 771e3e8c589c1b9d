// Transforms points between this view and another one (shared/neighbour.h).
// The includer has lib/cheap.glsl.

// The inverse of a place's rotation.
vec3 turned_there(vec3 v, NeighbourPlace place) { return v.x * place.x + v.y * place.y + v.z * place.z; }
vec3 point_there(vec3 point, NeighbourPlace place) { return turned_there(point - place.shift, place); }

vec3 turned_here(vec3 v, NeighbourPlace place) { return vec3(dot(place.x, v), dot(place.y, v), dot(place.z, v)); }
vec3 point_here(vec3 there, NeighbourPlace place) { return turned_here(there, place) + place.shift; }

// The ray through one of its pixels, z = 1.
vec3 ray_there(vec2 at, NeighbourPlace place) { return vec3(at * place.ray_step + place.ray_base, 1.0); }

// The pixel where it sees a point of its own space, and whether it does, in an image of that size.
bool seen_there(vec3 there, NeighbourPlace place, ivec2 size, out vec2 at) {
    at = (there.xy * (1.0 / there.z) - place.ray_base) / place.ray_step;
    return there.z > 0.0 && all(greaterThan(at, vec2(-0.5))) && all(lessThan(at, vec2(size) - 0.5));
}

// Of that pixel in images that lie one after the other; 0 where it sees nothing.
int index_there(int i, vec2 at, ivec2 size, bool seen) {
    return seen ? (i * size.y + nearest(at.y)) * size.x + nearest(at.x) : 0;
}

// A count for loops. Lavapipe (Mesa 22.3) compiles a shader anew on every run in which a uniform alone ends a loop that it can
// unroll, and keeps each: one pass took 12 KB and its compile time a frame. `index` >= 0 is any that differs between threads.
int not_compiled_in(int count, int index) { return max(count, min(index, 0)); }
