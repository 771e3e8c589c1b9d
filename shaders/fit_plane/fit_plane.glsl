// A plane in 1/z through weighted samples: 1/z is linear in the image on any plane. Included by the passes of the plane fit,
// which declare `samples`, their 1/z (0 where there is none), `relief`, and `k`.

// w = c + x a + y b, relative to the pixel and its own 1/z.
struct Plane {
    float a, b, c;
};
const Plane level = Plane(0.0, 0.0, 0.0);

struct Sums {
    float g, gx, gy, gxx, gxy, gyy, gw, gxw, gyw;
};
const Sums nothing = Sums(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0);

// Weights (1 - (r / tolerance)^2)^2, none beyond it (Tukey's biweight); `narrow` is 1 / tolerance.
void add(inout Sums s, float w_here, bool ok, int at, float x, float y, Plane plane, float narrow) {
    float recorded = imageLoad(samples, ok ? at : 0).x;
    float w = recorded - w_here;
    float e = (w - (plane.c + x * plane.a + y * plane.b)) * narrow;
    float g = positive(1.0 - e * e);
    g = ok && recorded > 0.0 ? g * g : 0.0;
    float gx = g * x, gy = g * y;
    s.g += g;
    s.gx += gx;
    s.gy += gy;
    s.gxx += gx * x;
    s.gxy += gx * y;
    s.gyy += gy * y;
    s.gw += g * w;
    s.gxw += gx * w;
    s.gyw += gy * w;
}

// Least squares; false where the samples lie on a line or are too few to tell a plane.
bool solve(Sums s, out Plane plane) {
    float n = 1.0 / max(s.g, 1e-6);
    float mx = s.gx * n, my = s.gy * n, mw = s.gw * n;
    float xx = s.gxx - mx * s.gx, xy = s.gxy - mx * s.gy, yy = s.gyy - my * s.gy;
    float xw = s.gxw - mx * s.gw, yw = s.gyw - my * s.gw;
    float determinant = xx * yy - xy * xy;
    bool good = s.g > 3.0 && determinant > 0.02 * xx * yy;
    float d = 1.0 / max(determinant, 1e-12);
    plane.a = good ? (xw * yy - yw * xy) * d : 0.0;
    plane.b = good ? (yw * xx - xw * xy) * d : 0.0;
    plane.c = good ? mw - mx * plane.a - my * plane.b : 0.0;
    return good;
}

// The row j of samples `spread` pixels apart, `reach` to either side.
#define COLUMN(i) { int o = nearest(float(i) * spread); int u = p.x + o; \
    add(sums, w_here, row_ok && uint(u) < uint(k.size.x), line + u, float(o), y, plane, narrow); }

void row(inout Sums sums, ivec2 p, float w_here, int j, int reach, float spread, Plane plane, float narrow) {
    int o = nearest(float(j) * spread);
    int v = p.y + o;
    bool row_ok = uint(v) < uint(k.size.y);
    int line = v * k.size.x;
    float y = float(o);
    if (reach == 3) COLUMN(-3)
    COLUMN(-2) COLUMN(-1) COLUMN(0) COLUMN(1) COLUMN(2)
    if (reach == 3) COLUMN(3)
}

Sums square5(ivec2 p, float w_here, float spread, Plane plane, float narrow) {
    Sums sums = nothing;
    row(sums, p, w_here, -2, 2, spread, plane, narrow);
    row(sums, p, w_here, -1, 2, spread, plane, narrow);
    row(sums, p, w_here, 0, 2, spread, plane, narrow);
    row(sums, p, w_here, 1, 2, spread, plane, narrow);
    row(sums, p, w_here, 2, 2, spread, plane, narrow);
    return sums;
}

Sums square7(ivec2 p, float w_here, float spread, Plane plane, float narrow) {
    Sums sums = nothing;
    row(sums, p, w_here, -3, 3, spread, plane, narrow);
    row(sums, p, w_here, -2, 3, spread, plane, narrow);
    row(sums, p, w_here, -1, 3, spread, plane, narrow);
    row(sums, p, w_here, 0, 3, spread, plane, narrow);
    row(sums, p, w_here, 1, 3, spread, plane, narrow);
    row(sums, p, w_here, 2, 3, spread, plane, narrow);
    row(sums, p, w_here, 3, 3, spread, plane, narrow);
    return sums;
}

layout(constant_id = spec_fused) const int is_fused = 0;

// Of a single frame's sigma, what is left where several have been averaged.
float relief_at(int index) { return is_fused == 0 ? 1.0 : imageLoad(relief, index).x; }

float sigma_of(float z) { return k.noise_floor + k.noise_per_z2 * z * z; }

float window_of(float z, float sigma) { return clamp(sqrt(k.window * sigma * k.camera.fx / z), 1.5, k.largest_radius); }

// A value may belong to a place that far from its pixel: sensors match windows, and alignment to colour takes the nearest pixel.
// Lateral noise of structured light is 0.8 px (Nguyen, Izadi and Lovell 2012).
const float lateral_px = 0.8;

// Sigma of 1/z on a slope.
float sigma_on(Plane plane, float sigma) {
    return sqrt(sigma * sigma + lateral_px * lateral_px * (plane.a * plane.a + plane.b * plane.b));
}

float sample_at(ivec2 q) {
    bool inside = all(lessThan(uvec2(q), uvec2(k.size)));
    return inside ? imageLoad(samples, q.y * k.size.x + q.x).x : 0.0;
}

// The slope along `step` where 1/z changes evenly from one side to the other, else 0: at a jump one side is level.
float slope_along(ivec2 p, float w_here, ivec2 step, ivec2 aside) {
    float first = 0.0, second = 0.0;
    bool all_there = true;
    for (int i = -1; i <= 1; ++i) {
        float before = sample_at(p - step + i * aside), after = sample_at(p + step + i * aside);
        all_there = all_there && before > 0.0 && after > 0.0;
        first += after - before;
        second += after + before - 2.0 * w_here;
    }
    return all_there && abs(second) < 0.4 * abs(first) ? first / (6.0 * float(step.x + step.y)) : 0.0;
}

// What the first samples are compared with: level, but for even slopes.
Plane slope_at(ivec2 p, float w_here, int reach) {
    return Plane(slope_along(p, w_here, ivec2(reach, 0), ivec2(0, 1)), slope_along(p, w_here, ivec2(0, reach), ivec2(1, 0)), 0.0);
}
