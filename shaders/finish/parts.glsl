// What visibility has a say in, and what it took. Included by passes that declare `expected_error`, `direct`, `k`, has_light and
// ambient_alone.

float confidence_at(int at) { return 1.0 - imageLoad(expected_error, at).x / hopeless_error; }

// The share of ambient light in blue, green and red.
vec3 ambient_part(int at) {
    if (has_light == 0) return vec3(1.0);
    float ratio = imageLoad(direct, at).x;
    return vec3(ambient_share(ratio, k.light.tint.z), ambient_share(ratio, k.light.tint.y),
                ambient_share(ratio, k.light.tint.x));
}

// What visibility has a say in.
vec3 shaded_part(int at) { return ambient_alone == 0 ? vec3(1.0) : ambient_part(at); }

float strong(float visible) { return isnan(visible) ? 1.0 : clamp(1.0 - k.strength + k.strength * visible, 0.0, 1.0); }

// Colour without what visibility took from its ambient part. No channel may exceed `white`, what can be stored, so that
// hues stay: a clipped pixel stays as it is.
vec3 unshaded_light(int at, vec3 light, float visible, float white) {
    vec3 share = shaded_part(at);
    float by = divisor(pow(strong(visible), k.unshade_power), confidence_at(at));
    // Of a photograph that holds its occlusion, the ambient part is what visibility has left: that alone is divided.
    vec3 more = light * (1.0 - share + share / by);
    float most = max(more.x, max(more.y, more.z));
    return most > white ? max(light, more * (white / most)) : more;
}
