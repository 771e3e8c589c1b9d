// Two numbers in [0, 1) per pixel, spread evenly over any neighbourhood: expects the texel buffer `noise_table`, which
// ao/screen/noise.cpp fills.
vec2 noise_at(ivec2 p) {
    return fract(imageLoad(noise_table, (p.y & (noise_side - 1)) * noise_side + (p.x & (noise_side - 1))).xy + k.turn);
}
