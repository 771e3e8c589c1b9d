// Clay works on inverse depth: on a plane 1/z is linear in the pixel, so averages and slopes over neighbours
// are exact there. Elsewhere they take out a sensor's depth steps, which are even in 1/z. Included by passes that declare
// `surface` and `k`.

layout(constant_id = spec_is_depth) const int is_depth = 0; // what `surface` holds: 1 = z, 0 = 1/z; 0 in holes

float inverse_at(int index) {
    float value = imageLoad(surface, index).x;
    return is_depth == 0 ? value : value > 0.0 ? 1.0 / value : 0.0;
}

const float jump = 0.01; // of 1/z, per pixel: a surface seen at 80 degrees stays in one piece

// The neighbours along one axis that lie on the pixel's own surface, up to the first hole or jump on either side: their
// number, and the sums of their offsets, of the offsets' squares, of differences in 1/z, and of offset times difference.
struct Line {
    float count, moment, squares, sum, product;
};

Line along(ivec2 p, ivec2 axis, float w_here, int reach) {
    Line line = Line(0.0, 0.0, 0.0, 0.0, 0.0);
    int here = p.y * k.size.x + p.x;
    float tolerance = w_here * jump;
    for (int side = -1; side <= 1; side += 2) {
        bool on = true;
        for (int i = 1; i <= reach; ++i) {
            ivec2 q = p + side * i * axis;
            bool inside = uint(q.x) < uint(k.size.x) && uint(q.y) < uint(k.size.y);
            float w = inverse_at(inside ? q.y * k.size.x + q.x : here);
            float apart = w - w_here, offset = float(side * i);
            on = on && inside && w != 0.0 && abs(apart) <= tolerance * float(i + 1);
            float one = on ? 1.0 : 0.0, difference = on ? apart : 0.0;
            line.count += one;
            line.moment += one * offset;
            line.squares += one * offset * offset;
            line.sum += difference;
            line.product += offset * difference;
        }
    }
    return line;
}
