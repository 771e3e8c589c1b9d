// What visibility has a say in, and what it took. Included by passes that declare `expected_error`, `direct`, `k`, has_light and
// ambient_alone.

float confidence_at(int at) { return 1.0 - imageLoad(expected_error, at).x / hopeless_error; }

// The share of ambient light.
float ambient_part(int at) { return has_light == 0 ? 1.0 : ambient_share(imageLoad(direct, at).x); }

// What visibility has a say in.
float shaded_part(int at) { return ambient_alone == 0 ? 1.0 : ambient_part(at); }

float strong(float visible) { return isnan(visible) ? 1.0 : clamp(1.0 - k.strength + k.strength * visible, 0.0, 1.0); }

// Colour without what visibility took from its ambient part. No channel may exceed `white`, what can be stored, so that
// hues stay: a clipped pixel stays as it is.
vec3 unshaded_light(int at, vec3 light, float visible, float white) {
    float share = shaded_part(at);
    float by = divisor(strong(visible), confidence_at(at));
    // Of a photograph that holds its occlusion, the ambient part is what visibility has left: that alone is divided.
    vec3 more = light * (1.0 - share + share / by);
    float most = max(more.x, max(more.y, more.z));
    return most > white ? max(light, more * (white / most)) : more;
}
