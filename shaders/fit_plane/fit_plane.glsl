// A plane in 1/z through weighted samples: 1/z is linear in the image on any plane. Included by the passes of the plane fit,
// which declare `samples`, their 1/z (`nowhere` where there is none), `relief`, and `k`.
//
// Almost all time goes into taking up a sample, so that is kept short: no sample is asked whether it is a hole or lies outside
// the image. Those are so far from what is expected that their weight is zero. And what a row has in common waits for its end.

// w = c + x a + y b, relative to the pixel and its own 1/z.
struct Plane {
    float a, b, c;
};
const Plane level = Plane(0.0, 0.0, 0.0);

// Of samples at (x, y) with weight g and residual r, their distance from the plane that is expected.
struct Sums {
    float g, gx, gy, gxx, gxy, gyy, gr, gxr, gyr;
};
const Sums nothing = Sums(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0);

struct Row {
    float g, gx, gxx, gr, gxr;
};

// (1 - (r / tolerance)^2)^2, none beyond it (Tukey's biweight); `narrow` is 1 / tolerance.
float weight(float r, float narrow) {
    float e = r * narrow, g = positive(1.0 - e * e);
    return g * g;
}

Row row_from(float middle, float narrow) {
    float g = weight(middle, narrow);
    return Row(g, 0.0, 0.0, g * middle, 0.0);
}

// Residuals of samples x to either side.
void add_pair(inout Row row, float x, float before, float after, float narrow) {
    float g = weight(before, narrow), h = weight(after, narrow), both = g + h;
    float gr = g * before, hr = h * after;
    row.g += both;
    row.gx += x * (h - g);
    row.gxx += x * x * both;
    row.gr += gr + hr;
    row.gxr += x * (hr - gr);
}

void add_row(inout Sums s, float y, Row row) {
    s.g += row.g;
    s.gx += row.gx;
    s.gy += y * row.g;
    s.gxx += row.gxx;
    s.gxy += y * row.gx;
    s.gyy += y * y * row.g;
    s.gr += row.gr;
    s.gxr += row.gxr;
    s.gyr += y * row.gr;
}

// Least squares; false where the samples lie on a line or are too few to tell a plane, which then is level.
bool solve(Sums s, Plane expected, out Plane plane) {
    float n = 1.0 / max(s.g, 1e-6);
    float mx = s.gx * n, my = s.gy * n, mr = s.gr * n;
    float xx = s.gxx - mx * s.gx, xy = s.gxy - mx * s.gy, yy = s.gyy - my * s.gy;
    float xr = s.gxr - mx * s.gr, yr = s.gyr - my * s.gr;
    float determinant = xx * yy - xy * xy;
    bool good = s.g > 3.0 && determinant > 0.02 * xx * yy;
    float d = 1.0 / max(determinant, 1e-12);
    float a = (xr * yy - yr * xy) * d, b = (yr * xx - xr * xy) * d;
    plane = level;
    if (good) plane = Plane(expected.a + a, expected.b + b, expected.c + mr - mx * a - my * b);
    return good;
}

layout(constant_id = spec_fused) const int is_fused = 0;

// Of a single frame's sigma, what is left where several have been averaged.
float relief_at(int index) { return is_fused == 0 ? 1.0 : imageLoad(relief, index).x; }

float sigma_of(float z) { return k.noise_floor + k.noise_per_z2 * z * z; }

// A value may belong to a place that far from its pixel: sensors match windows, and alignment to colour takes the nearest pixel.
// Lateral noise of structured light is 0.8 px (Nguyen, Izadi and Lovell 2012).
const float lateral_px = 0.8;

// Sigma of 1/z on a slope.
float sigma_on(Plane plane, float sigma) {
    return sqrt(sigma * sigma + lateral_px * lateral_px * (plane.a * plane.a + plane.b * plane.b));
}

// The slope from three samples on one side to three on the other, `apart` pixels away, where 1/z changes evenly, else 0: at a
// jump one side is level. A hole among them takes both sums far and almost equally so.
float slope_between(vec3 before, vec3 after, float w_here, float apart) {
    float rise = dot(after - before, vec3(1.0)), bend = dot(after + before, vec3(1.0)) - 6.0 * w_here;
    return abs(bend) < 0.4 * abs(rise) ? rise / (3.0 * apart) : 0.0;
}
