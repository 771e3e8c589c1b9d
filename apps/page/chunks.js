// Points unpacked: chunks of clouds, which points.cpp writes, and depth frames of previews.
"use strict";
{
  const { unpacked } = scanshade;

  /** 16-bit numbers of zigzag differences in two planes, low bytes first; of 24 bits in three. */
  const whole_numbers = (bytes, at, count, planes = 2) => {
    const values = planes > 2 ? new Uint32Array(count) : new Uint16Array(count), mask = planes > 2 ? 0xffffff : 0xffff;
    let before = 0;
    for (let i = 0; i < count; ++i) {
      const folded = bytes[at + i] | bytes[at + count + i] << 8 | (planes > 2 ? bytes[at + 2 * count + i] << 16 : 0);
      before = (before + (folded & 1 ? -(folded + 1) / 2 : folded / 2)) & mask;
      values[i] = before;
    }
    return values;
  };
  const summed = (bytes, at, count) => {
    const values = new Uint8Array(count);
    let before = 0;
    for (let i = 0; i < count; ++i) values[i] = before = (before + bytes[at + i]) & 0xff;
    return values;
  };

  /** A unit vector of two bytes: the octahedron's surface unfolded (Cigolle et al. 2014). */
  const unfolded = (a, b) => {
    let x = a / 127.5 - 1, y = b / 127.5 - 1;
    const z = 1 - Math.abs(x) - Math.abs(y);
    if (z < 0) [x, y] = [(1 - Math.abs(y)) * Math.sign(x || 1), (1 - Math.abs(x)) * Math.sign(y || 1)];
    const length = Math.hypot(x, y, z) || 1;
    return [x / length, y / length, z / length];
  };

  /**
   * Of a file of points, the corner and edge of its node's box, and the facts of its cloud.
   * origin: doubles, in the file's system. positions: floats from there, 3 a point, so that a map's coordinates keep their digits.
   * paint: bytes, red green blue and AO's code. more: confidence's code and a normal. fields: {name, low, high, step, whole, codes()}.
   */
  scanshade.opened_chunk = async (data, { low, edge }, facts) => {
    const { count, bits } = data, step = edge / 2 ** bits, planes = bits > 16 ? 3 : 2, positions = new Float32Array(3 * count), paint = new Uint8Array(4 * count), more = new Uint8Array(4 * count);
    const bytes = await unpacked(data.positions);
    for (let axis = 0; axis < 3; ++axis) {
      const values = whole_numbers(bytes, planes * count * axis, count, planes);
      for (let i = 0; i < count; ++i) positions[3 * i + axis] = (values[i] + 0.5) * step;
    }
    const colour = data.colour ? await unpacked(data.colour) : null;
    if (colour) {
      const g = summed(colour, 0, count), r = summed(colour, count, count), b = summed(colour, 2 * count, count);
      for (let i = 0; i < count; ++i) {
        paint[4 * i] = r[i] + g[i];
        paint[4 * i + 1] = g[i];
        paint[4 * i + 2] = b[i] + g[i];
      }
    }
    const ao = summed(await unpacked(data.ao), 0, count);
    for (let i = 0; i < count; ++i) paint[4 * i + 3] = ao[i];
    if (data.confidence) {
      const values = summed(await unpacked(data.confidence), 0, count);
      for (let i = 0; i < count; ++i) more[4 * i] = values[i];
    }
    if (data.normal) {
      const normal = await unpacked(data.normal), x = summed(normal, 0, count), y = summed(normal, count, count);
      for (let i = 0; i < count; ++i) {
        const n = unfolded(x[i], y[i]);
        for (let axis = 0; axis < 3; ++axis) more[4 * i + 1 + axis] = Math.round(127 * n[axis]) & 0xff;
      }
    }
    // Fields stay packed until they are asked for.
    const fields = facts.fields.map((field, i) => ({ ...field, codes: scanshade.once(async () =>
      data.codes[i] ? whole_numbers(await unpacked(data.codes[i]), 0, count) : new Uint16Array(count).fill(1)) }));
    return { count, origin: low, step: [step, step, step], positions, paint, more, fields, more_fields: facts.more_fields,
      has: { colour: Boolean(colour), ao: true, confidence: Boolean(data.confidence), normal: Boolean(data.normal), sides: Boolean(data.normal) } };
  };

  /** The pixels of a preview's colour picture, at the size of its maps. */
  const colour_pixels = async (preview) => {
    if (!preview.picture || !preview.fits) return null;
    const picture = new Image();
    picture.src = preview.picture;
    await picture.decode();
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = preview.size;
    const context = canvas.getContext("2d", { willReadFrequently: true });
    context.drawImage(picture, 0, 0, canvas.width, canvas.height);
    return context.getImageData(0, 0, canvas.width, canvas.height).data;
  };

  /** A point (w = 1) or direction (w = 0) of the camera in the world; poses are 3 x 4, row by row. */
  const in_world = (pose, p, w) => [0, 1, 2].map((i) => pose[4 * i] * p[0] + pose[4 * i + 1] * p[1] + pose[4 * i + 2] * p[2] + w * pose[4 * i + 3]);

  scanshade.in_world = in_world;

  /** A depth frame as a chunk from its camera's place, in world space where it has a pose. Every `stride`-th pixel both ways. */
  scanshade.chunk_of_preview = async (preview, pose, stride) => {
    const [width, height] = preview.size, normals = scanshade.normals_of(preview), pixels = await colour_pixels(preview);
    const most = Math.ceil(width / stride) * Math.ceil(height / stride);
    const positions = new Float32Array(3 * most), paint = new Uint8Array(4 * most), more = new Uint8Array(4 * most);
    let count = 0;
    for (let v = 0; v < height; v += stride)
      for (let u = 0; u < width; u += stride) {
        const i = v * width + u, z = preview.z_m[i];
        if (!(z > 0)) continue;
        let p = scanshade.point_of(preview, u, v, z), n = [normals[3 * i], normals[3 * i + 1], normals[3 * i + 2]];
        if (pose) {
          p = in_world(pose, p, 0);
          n = in_world(pose, n, 0);
        }
        positions.set(p, 3 * count);
        if (pixels) paint.set(pixels.subarray(4 * i, 4 * i + 3), 4 * count);
        paint[4 * count + 3] = preview.ao ? preview.ao[i] : 0;
        more[4 * count] = preview.confidence ? preview.confidence[i] : 0;
        for (let axis = 0; axis < 3; ++axis) more[4 * count + 1 + axis] = Math.round(127 * n[axis]) & 0xff;
        ++count;
      }
    return { count, origin: pose ? [pose[3], pose[7], pose[11]] : [0, 0, 0], positions: positions.subarray(0, 3 * count),
      paint: paint.subarray(0, 4 * count), more: more.subarray(0, 4 * count), fields: [], more_fields: 0,
      has: { colour: Boolean(pixels), ao: Boolean(preview.ao), confidence: Boolean(preview.confidence), normal: true } };
  };

}
