// The small maps of a frame's preview, unpacked, and their pictures. preview.cpp writes what is read here.
"use strict";
{
  const { unpacked } = scanshade;

  /** Differences back to values. */
  const summed = (bytes) => {
    for (let i = 1; i < bytes.length; ++i) bytes[i] += bytes[i - 1];
    return bytes;
  };

  /** Depth in metres; 0 = hole. Floats were cut to their upper bits, and stored as differences in two planes. */
  const depth_of = (planes) => {
    const dropped = 12, count = planes.length / 2, bits = new Uint32Array(count), one = 0x3f800000 >>> dropped;
    let before = one;
    for (let i = 0; i < count; ++i) {
      const stored = planes[i] | planes[count + i] << 8;
      if (stored === 0) continue;
      const folded = stored - 1;
      before += folded & 1 ? -(folded + 1) / 2 : folded / 2;
      bits[i] = (before << dropped) | (1 << (dropped - 1)); // the middle of what was cut off
    }
    return new Float32Array(bits.buffer);
  };

  /** {size, step, first, whole, camera, range, z_m, ao, confidence, reference: codes, 0 = none, picture: an address}. */
  scanshade.opened_preview = async (data) => {
    const opened = { size: data.size, step: data.step, first: data.first, whole: data.whole, camera: data.camera, range: data.range, fits: data.fits };
    const count = data.size[0] * data.size[1], bytes = await unpacked(data.bytes);
    let at = 0;
    const next = (length) => bytes.subarray(at, at += length);
    for (const name of data.maps) // one stream, in this order
      if (name === "depth") opened.z_m = depth_of(next(2 * count));
      else opened[name] = summed(next(count));
    if (data.colour) opened.picture = "data:image/jpeg;base64," + data.colour;
    return opened;
  };

  /** Codes back to 0 .. 1; visibility has 128 levels, confidence 32. */
  scanshade.share_of = (code, levels) => (code === 0 ? NaN : (code - 1) / (levels - 1));

  // Turbo (Mikhailov, 2019), by the polynomials its author published for it.
  const turbo = (t) => {
    const r = 0.13572138 + t * (4.6153926 + t * (-42.66032258 + t * (132.13108234 + t * (-152.94239396 + t * 59.28637943))));
    const g = 0.09140261 + t * (2.19418839 + t * (4.84296658 + t * (-14.18503333 + t * (4.27729857 + t * 2.82956604))));
    const b = 0.1066733 + t * (12.64194608 + t * (-60.58204836 + t * (110.36276771 + t * (-89.90310912 + t * 27.34824973))));
    return [r, g, b].map((value) => Math.max(0, Math.min(255, Math.round(255 * value))));
  };
  // Near is warm, far is cold.
  scanshade.depth_colours = Array.from({ length: 256 }, (_, i) => turbo(1 - i / 255));
  const none = [28, 40, 64]; // as the program's pictures show pixels without a surface

  const canvas_of = (size) => {
    const canvas = document.createElement("canvas");
    canvas.width = size[0];
    canvas.height = size[1];
    return canvas;
  };

  const painted = (size, colour_at) => {
    const canvas = canvas_of(size), context = canvas.getContext("2d"), image = context.createImageData(size[0], size[1]);
    for (let i = 0, at = 0; i < size[0] * size[1]; ++i, at += 4) {
      const colour = colour_at(i);
      image.data[at] = colour[0];
      image.data[at + 1] = colour[1];
      image.data[at + 2] = colour[2];
      image.data[at + 3] = 255;
    }
    context.putImageData(image, 0, 0);
    return canvas;
  };

  const greys = (levels) => Array.from({ length: levels + 1 }, (_, code) => (code === 0 ? none : Array(3).fill(Math.round(255 * (code - 1) / (levels - 1)))));
  const grey_of_ao = greys(128), grey_of_confidence = greys(32);

  /** Blue is too dark, red too bright, white right; half of the range is full colour. */
  const difference_colour = (apart) => {
    const t = Math.max(-1, Math.min(1, apart / 0.5)), pale = Math.round(240 * (1 - Math.abs(t)));
    return t < 0 ? [pale, Math.round(pale + 90 * -t), Math.round(240 - 40 * -t)] : [Math.round(240 - 50 * t), Math.round(pale + 50 * t), pale];
  };

  scanshade.painted = {
    depth: (preview) => {
      const [near, far] = preview.range, scale = far > near ? 255 / (far - near) : 0;
      return painted(preview.size, (i) => {
        const z = preview.z_m[i];
        return z > 0 ? scanshade.depth_colours[Math.max(0, Math.min(255, Math.round((z - near) * scale)))] : [0, 0, 0];
      });
    },
    ao: (preview) => painted(preview.size, (i) => grey_of_ao[preview.ao[i]]),
    reference: (preview) => painted(preview.size, (i) => grey_of_ao[preview.reference[i]]),
    confidence: (preview) => painted(preview.size, (i) => grey_of_confidence[preview.confidence[i]]),
    difference: (preview) => painted(preview.size, (i) => {
      const a = preview.ao[i], b = preview.reference[i];
      return a && b ? difference_colour((a - b) / 127) : none;
    }),
    // Depth lit from the camera: what lies under the visibility where there is no colour.
    clay: (preview) => {
      const [width, height] = preview.size, normals = scanshade.normals_of(preview);
      return painted(preview.size, (i) => {
        if (!(preview.z_m[i] > 0)) return none;
        const light = Math.abs(normals[3 * i + 2]), grey = Math.round(60 + 165 * light);
        return [grey, grey, grey];
      }, width, height);
    },
  };

  /** Where a preview's pixel is in the camera's space. */
  scanshade.point_of = (preview, u, v, z) => {
    const [fx, fy, cx, cy] = preview.camera;
    const x = preview.first + u * preview.step, y = preview.first + v * preview.step;
    return [(x - cx) / fx * z, (y - cy) / fy * z, z];
  };

  /** Unit normals towards the camera, three numbers a pixel, from the nearer of the neighbours on either side. */
  scanshade.normals_of = (preview) => {
    const [width, height] = preview.size, { z_m } = preview, normals = new Float32Array(3 * width * height);
    if (!preview.camera) return normals;
    const slope = (u, v, du, dv) => {
      const z = z_m[v * width + u];
      let best = null;
      for (const side of [1, -1]) {
        const a = u + side * du, b = v + side * dv;
        if (a < 0 || b < 0 || a >= width || b >= height) continue;
        const other = z_m[b * width + a];
        if (other > 0 && (best === null || Math.abs(other - z) < Math.abs(best.other - z))) best = { a, b, other, side };
      }
      if (!best) return null;
      const here = scanshade.point_of(preview, u, v, z), there = scanshade.point_of(preview, best.a, best.b, best.other);
      return here.map((value, axis) => best.side * (there[axis] - value));
    };
    for (let v = 0; v < height; ++v)
      for (let u = 0; u < width; ++u) {
        const i = v * width + u;
        if (!(z_m[i] > 0)) continue;
        const a = slope(u, v, 1, 0), b = slope(u, v, 0, 1);
        if (!a || !b) continue;
        const n = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
        const length = Math.hypot(...n) * (n[2] > 0 ? -1 : 1);
        if (length !== 0) for (let axis = 0; axis < 3; ++axis) normals[3 * i + axis] = n[axis] / length;
      }
    return normals;
  };
}
