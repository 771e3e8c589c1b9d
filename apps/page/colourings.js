// What points can be coloured by: their colour, their normal, and numbers: AO, confidence, height, and any field of the file.
"use strict";
{
  const grey = Array.from({ length: 256 }, (_, i) => [i, i, i]);
  const cold_to_warm = [...scanshade.depth_colours].reverse();

  // "LAS Specification 1.4 - R15", table 17.
  const las_classes = ["never classified", "unclassified", "ground", "low vegetation", "medium vegetation", "high vegetation", "building", "low noise", "reserved", "water",
    "rail", "road surface", "reserved", "wire, guard", "wire, conductor", "transmission tower", "wire connector", "bridge deck", "high noise", "overhead structure",
    "ignored ground", "snow", "temporal exclusion"];
  const las_colours = [[150, 150, 150], [190, 190, 190], [166, 118, 66], [178, 223, 138], [90, 190, 80], [30, 120, 50], [222, 82, 60], [255, 0, 255], [120, 120, 160], [50, 120, 230],
    [140, 90, 160], [90, 95, 105], [160, 160, 200], [250, 200, 60], [240, 150, 40], [120, 60, 30], [200, 160, 60], [210, 140, 140], [255, 80, 200], [110, 200, 210],
    [200, 180, 150], [235, 245, 255], [90, 80, 120]];
  /** Colours that neighbours tell apart: hues in steps of the golden angle. */
  const other_colour = (value) => [0, 120, 240].map((shift) => Math.round(150 + 90 * Math.cos((value * 137.508 + shift) * Math.PI / 180)));

  const is_las_class = (name) => /(^|_)classification$/i.test(name);
  /** Whole numbers of 0 to 255 of which few differ, such as classes and returns. */
  const is_classes = ({ name, low, high, whole }) => whole && low >= 0 && high < 256 && (high - low < 12 || /class|label|return|segment/i.test(name));

  scanshade.class_colour = (name, value) => (is_las_class(name) && las_colours[value]) || other_colour(value);
  scanshade.class_words = (name, value) => (!is_las_class(name) ? "" : las_classes[value] || (value < 64 ? "reserved" : "user's own"));

  /** The chunk's own bytes as codes: 0 = none, 1 .. levels = 0 .. 1. */
  const shares = (bytes, at, levels) => ({ count }) => {
    const codes = new Uint16Array(count);
    for (let i = 0; i < count; ++i) codes[i] = bytes[4 * i + at];
    return { codes, low: 0, step: 1 / (levels - 1) };
  };
  const heights = (up) => ({ count, positions, origin }) => {
    const along = (at) => up[0] * positions[at] + up[1] * positions[at + 1] + up[2] * positions[at + 2];
    const base = up[0] * origin[0] + up[1] * origin[1] + up[2] * origin[2], codes = new Uint16Array(count);
    let low = Infinity, high = -Infinity;
    for (let i = 0; i < count; ++i) {
      low = Math.min(low, along(3 * i));
      high = Math.max(high, along(3 * i));
    }
    const step = (high - low) / 65534 || 1;
    for (let i = 0; i < count; ++i) codes[i] = 1 + Math.round((along(3 * i) - low) / step);
    return { codes, low: base + low, step };
  };
  const field_of = (name) => async (chunk) => {
    const field = chunk.fields.find((each) => each.name === name);
    return field ? { codes: await field.codes(), low: field.low, step: field.step } : { codes: new Uint16Array(chunk.count), low: 0, step: 1 };
  };

  /**
   * What a first chunk offers, each {key, label, base: as the painter's, ramp, range, classes: their field's name,
   * numbers(chunk): {codes, low, step}, where a point's value is low + (code - 1) step, code 0 = none}.
   */
  scanshade.colourings = (chunk, up) => {
    const { has } = chunk;
    const offered = [{ key: "colour", label: has.colour ? "RGB" : "plain", base: 0 }];
    if (has.ao) offered.push({ key: "ao", label: "AO", base: 1, ramp: grey, range: [0, 1], unshaded: true, numbers: (each) => shares(each.paint, 3, 128)(each) });
    if (has.confidence) offered.push({ key: "confidence", label: "confidence", base: 1, ramp: grey, range: [0, 1], numbers: (each) => shares(each.more, 0, 32)(each) });
    if (has.normal) offered.push({ key: "normal", label: "normal", base: 2 });
    offered.push({ key: "height", label: "height", base: 1, ramp: cold_to_warm, numbers: heights(up) });
    for (const field of chunk.fields) {
      const one = { key: `field ${field.name}`, label: field.name, base: 1, numbers: field_of(field.name) };
      if (!is_classes(field)) one.ramp = /intensity|reflect/i.test(field.name) ? grey : cold_to_warm;
      else Object.assign(one, { classes: field.name, range: [0, 255], ramp: Array.from({ length: 256 }, (_, i) => scanshade.class_colour(field.name, i)) });
      offered.push(one);
    }
    return offered;
  };

  /** The values between which 98 of 100 points lie. */
  scanshade.usual_range = ({ codes, low, step }) => {
    const known = codes.filter((code) => code > 0).sort();
    if (known.length === 0) return [0, 1];
    const at = (share) => low + (known[Math.round(share * (known.length - 1))] - 1) * step;
    const [from, to] = [at(0.01), at(0.99)];
    return from < to ? [from, to] : [from, from + (step || 1)];
  };

  /** How many points of the clouds have each class, by its value. */
  scanshade.class_counts = (clouds, name) => {
    const counts = new Map();
    for (const { fields } of clouds) for (const [value, count] of fields.find((each) => each.name === name)?.counts || []) counts.set(value, (counts.get(value) || 0) + count);
    return new Map([...counts].sort((a, b) => a[0] - b[0]));
  };

  /** So many digits that two neighbouring values differ; step 0 = all values are this one. */
  scanshade.in_steps = (value, step) => (step > 0 ? value.toFixed(Math.max(0, Math.min(9, Math.ceil(-Math.log10(step) - 1e-9)))) : String(Number(value.toPrecision(9))));
}
