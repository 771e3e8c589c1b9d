// The normal of a pixel, zero in holes: expects the texel buffer `surfaces`, normal and depth of each pixel.
vec3 normal_at(int index) { return imageLoad(surfaces, index).xyz; }
