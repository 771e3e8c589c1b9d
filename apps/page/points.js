// Points in space (WebGL2): a frame's depth, frames with poses together, and clouds in chunks, the first of which is an
// even sample of the whole.
"use strict";
{
  const { by_id, make, unpacked } = scanshade;

  // -------------------------------------------------------------------------------------------------- chunks

  /** 16-bit numbers of zigzag differences in two planes, low bytes first. */
  const whole_numbers = (bytes, at, count) => {
    const values = new Uint16Array(count);
    let before = 0;
    for (let i = 0; i < count; ++i) {
      const folded = bytes[at + i] | bytes[at + count + i] << 8;
      before = (before + (folded & 1 ? -(folded + 1) / 2 : folded / 2)) & 0xffff;
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

  /** origin: doubles, in the file's system. positions: floats from there, 3 a point, so that a map's coordinates keep their digits. paint: bytes, red green blue and AO's code. more: confidence's code and a normal. */
  const opened_chunk = async (data) => {
    const { count, box } = data, positions = new Float32Array(3 * count), paint = new Uint8Array(4 * count), more = new Uint8Array(4 * count);
    const bytes = await unpacked(data.positions);
    for (let axis = 0; axis < 3; ++axis) {
      const values = whole_numbers(bytes, 2 * count * axis, count);
      for (let i = 0; i < count; ++i) positions[3 * i + axis] = values[i] * box[3 + axis] / 65535;
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
    return { count, origin: box.slice(0, 3), positions, paint, more, has: { colour: Boolean(colour), ao: true, confidence: Boolean(data.confidence), normal: Boolean(data.normal), sides: Boolean(data.normal) } };
  };

  scanshade.opened_chunk = opened_chunk;

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

  const in_world = (pose, p, w) => [0, 1, 2].map((i) => pose[4 * i] * p[0] + pose[4 * i + 1] * p[1] + pose[4 * i + 2] * p[2] + w * pose[4 * i + 3]);

  /** A depth frame as a chunk from its camera's place, in world space where it has a pose. Every `stride`-th pixel both ways. */
  const chunk_of_preview = async (preview, pose, stride) => {
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
    return { count, origin: pose ? [pose[3], pose[7], pose[11]] : [0, 0, 0], positions: positions.subarray(0, 3 * count), paint: paint.subarray(0, 4 * count), more: more.subarray(0, 4 * count),
      has: { colour: Boolean(pixels), ao: Boolean(preview.ao), confidence: Boolean(preview.confidence), normal: true } };
  };

  // -------------------------------------------------------------------------------------------------- drawing

  const point_vertex = `#version 300 es
    layout(location = 0) in vec3 position;
    layout(location = 1) in vec4 paint;
    layout(location = 2) in float sureness;
    layout(location = 3) in vec3 normal;
    uniform mat4 clip_from_eye;
    uniform vec3 origin; // from the eye
    uniform float pixels_per_radian, spacing, slope, size, strength, clip_low, clip_high;
    uniform int mode;
    uniform bool has_colour, fronts_only;
    out vec3 shown;
    float linear(float v) { return v <= 0.04045 ? v / 12.92 : pow((v + 0.055) / 1.055, 2.4); }
    float coded(float v) { return v <= 0.0031308 ? 12.92 * v : 1.055 * pow(v, 1.0 / 2.4) - 0.055; }
    void main() {
      vec3 from_eye = origin + position;
      gl_Position = clip_from_eye * vec4(from_eye, 1.0);
      float across = size * (spacing + slope * length(position));
      gl_PointSize = clamp(across * pixels_per_radian / max(gl_Position.w, 1e-6), 1.5, 32.0);
      // A room seen from outside opens where its walls' backs would be.
      if (fronts_only && dot(normal, normal) > 0.1 && dot(normal, from_eye) > 0.0) gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
      float code = floor(paint.a * 255.0 + 0.5);
      bool known = code > 0.5;
      float ao = clamp(((code - 1.0) / 127.0 - clip_low) / max(clip_high - clip_low, 1e-3), 0.0, 1.0);
      float open = known ? mix(1.0, ao, strength) : 1.0;
      vec3 side = normal;
      float lit = dot(side, side) > 0.1 ? 0.35 + 0.5 * abs(dot(normalize(side), normalize(from_eye))) : 0.75;
      vec3 base = has_colour ? paint.rgb : vec3(lit);
      if (mode == 0) shown = base;
      else if (mode == 1) shown = known ? vec3(ao) : vec3(0.11, 0.16, 0.25);
      else if (mode == 2) shown = vec3(max(floor(sureness * 255.0 + 0.5) - 1.0, 0.0) / 31.0);
      else if (mode == 3) shown = vec3(coded(linear(base.r) * open), coded(linear(base.g) * open), coded(linear(base.b) * open));
      else shown = 0.5 + 0.5 * side;
    }`;
  const point_fragment = `#version 300 es
    precision highp float;
    in vec3 shown;
    out vec4 colour;
    void main() {
      vec2 off = gl_PointCoord - 0.5;
      if (dot(off, off) > 0.25) discard;
      colour = vec4(shown, 1.0);
    }`;
  const screen_vertex = `#version 300 es
    void main() { gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0); }`;
  // Eye-dome lighting (Boucheny 2009): a pixel darkens by how far it lies behind its neighbours, in log depth.
  const screen_fragment = `#version 300 es
    precision highp float;
    uniform sampler2D picture, depths;
    uniform float near, far, reach;
    uniform bool edges;
    uniform vec3 background;
    out vec4 colour;
    float log_depth(ivec2 at) {
      ivec2 last = textureSize(depths, 0) - 1;
      float d = texelFetch(depths, clamp(at, ivec2(0), last), 0).r * 2.0 - 1.0;
      return log2(2.0 * far * near / (far + near - d * (far - near)));
    }
    void main() {
      ivec2 at = ivec2(gl_FragCoord.xy);
      float raw = texelFetch(depths, at, 0).r;
      gl_FragDepth = raw;
      if (raw >= 1.0) { colour = vec4(background, 1.0); return; }
      vec3 shown = texelFetch(picture, at, 0).rgb;
      if (edges) {
        float here = log_depth(at), sum = 0.0;
        for (int k = 0; k < 8; ++k) {
          float angle = float(k) * 0.785398;
          ivec2 beside = at + ivec2(round(reach * vec2(cos(angle), sin(angle))));
          sum += min(max(0.0, here - log_depth(beside)), 0.5);
        }
        shown *= max(0.25, exp(-3.0 * sum));
      }
      colour = vec4(shown, 1.0);
    }`;
  const line_vertex = `#version 300 es
    layout(location = 0) in vec3 position;
    uniform mat4 clip_from_eye;
    void main() { gl_Position = clip_from_eye * vec4(position, 1.0); }`;
  const line_fragment = `#version 300 es
    precision highp float;
    uniform vec4 tint;
    out vec4 colour;
    void main() { colour = tint; }`;

  const program_of = (gl, vertex, fragment) => {
    const program = gl.createProgram();
    for (const [type, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(type);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    const at = {};
    for (let i = 0; i < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); ++i) {
      const { name } = gl.getActiveUniform(program, i);
      at[name] = gl.getUniformLocation(program, name);
    }
    return { program, at };
  };

  /** Draws chunks and cameras into the canvas. */
  const painter_of = (canvas) => {
    const gl = canvas.getContext("webgl2", { antialias: false, alpha: false, powerPreference: "high-performance" });
    if (!gl) return null;
    const points = program_of(gl, point_vertex, point_fragment), screen = program_of(gl, screen_vertex, screen_fragment), lines = program_of(gl, line_vertex, line_fragment);
    const nothing = gl.createVertexArray(), target = gl.createFramebuffer();
    let picture = null, depths = null, size = [0, 0];
    const texture = (format, width, height) => {
      const made = gl.createTexture();
      gl.bindTexture(gl.TEXTURE_2D, made);
      gl.texStorage2D(gl.TEXTURE_2D, 1, format, width, height);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
      return made;
    };
    const fit_targets = () => {
      if (picture && size[0] === canvas.width && size[1] === canvas.height) return;
      gl.deleteTexture(picture);
      gl.deleteTexture(depths);
      size = [canvas.width, canvas.height];
      picture = texture(gl.RGBA8, ...size);
      depths = texture(gl.DEPTH_COMPONENT24, ...size);
      gl.bindFramebuffer(gl.FRAMEBUFFER, target);
      gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, picture, 0);
      gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, depths, 0);
    };
    const buffer_of = (data) => {
      const made = gl.createBuffer();
      gl.bindBuffer(gl.ARRAY_BUFFER, made);
      gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
      return made;
    };
    return {
      gl,
      upload(chunk) {
        const vertices = gl.createVertexArray();
        gl.bindVertexArray(vertices);
        const position = buffer_of(chunk.positions);
        gl.enableVertexAttribArray(0);
        gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
        const paint = buffer_of(chunk.paint);
        gl.enableVertexAttribArray(1);
        gl.vertexAttribPointer(1, 4, gl.UNSIGNED_BYTE, true, 0, 0);
        const more = buffer_of(chunk.more);
        gl.enableVertexAttribArray(2);
        gl.vertexAttribPointer(2, 1, gl.UNSIGNED_BYTE, true, 4, 0);
        gl.enableVertexAttribArray(3);
        gl.vertexAttribPointer(3, 3, gl.BYTE, true, 4, 1);
        gl.bindVertexArray(null);
        return { vertices, buffers: [position, paint, more], count: chunk.count, has: chunk.has, origin: chunk.origin, spacing: chunk.spacing || 0, slope: chunk.slope || 0 };
      },
      upload_lines(positions) {
        const vertices = gl.createVertexArray();
        gl.bindVertexArray(vertices);
        const buffer = buffer_of(positions);
        gl.enableVertexAttribArray(0);
        gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
        gl.bindVertexArray(null);
        return { vertices, buffers: [buffer], count: positions.length / 3 };
      },
      /** Calls back once the device has drawn what it was asked to. */
      when_done(call) {
        const sync = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
        gl.flush();
        const look = () => {
          if (gl.getSyncParameter(sync, gl.SYNC_STATUS) !== gl.SIGNALED) return void setTimeout(look, 8);
          gl.deleteSync(sync);
          call();
        };
        setTimeout(look, 0);
      },
      release(each) {
        gl.deleteVertexArray(each.vertices);
        for (const buffer of each.buffers) gl.deleteBuffer(buffer);
      },
      draw(chunks, outlines, camera, look) {
        fit_targets();
        const { near, far } = look, clip = camera.matrix(canvas.width / canvas.height, near, far);
        gl.viewport(0, 0, canvas.width, canvas.height);
        gl.bindFramebuffer(gl.FRAMEBUFFER, target);
        gl.enable(gl.DEPTH_TEST);
        gl.depthFunc(gl.LESS);
        gl.clearColor(0, 0, 0, 1);
        gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
        gl.useProgram(points.program);
        gl.uniformMatrix4fv(points.at.clip_from_eye, false, clip);
        gl.uniform1f(points.at.pixels_per_radian, canvas.height / (2 * camera.half_height));
        gl.uniform1f(points.at.size, look.size);
        gl.uniform1f(points.at.strength, look.strength);
        gl.uniform1f(points.at.clip_low, look.clip_low);
        gl.uniform1f(points.at.clip_high, look.clip_high);
        gl.uniform1i(points.at.mode, look.mode);
        for (const chunk of chunks) {
          gl.uniform1i(points.at.has_colour, chunk.has.colour ? 1 : 0);
          gl.uniform1f(points.at.spacing, chunk.spacing);
          gl.uniform1f(points.at.slope, chunk.slope);
          gl.uniform1i(points.at.fronts_only, chunk.has.sides && !look.backs ? 1 : 0);
          gl.uniform3fv(points.at.origin, chunk.origin.map((value, axis) => value - camera.eye[axis]));
          gl.bindVertexArray(chunk.vertices);
          gl.drawArrays(gl.POINTS, 0, chunk.count);
        }
        gl.bindFramebuffer(gl.FRAMEBUFFER, null);
        gl.depthFunc(gl.ALWAYS);
        gl.useProgram(screen.program);
        gl.activeTexture(gl.TEXTURE0);
        gl.bindTexture(gl.TEXTURE_2D, picture);
        gl.activeTexture(gl.TEXTURE1);
        gl.bindTexture(gl.TEXTURE_2D, depths);
        gl.uniform1i(screen.at.picture, 0);
        gl.uniform1i(screen.at.depths, 1);
        gl.uniform1f(screen.at.near, near);
        gl.uniform1f(screen.at.far, far);
        gl.uniform1f(screen.at.reach, Math.max(1, canvas.height / 480));
        gl.uniform1i(screen.at.edges, look.edges ? 1 : 0);
        gl.uniform3fv(screen.at.background, look.background);
        gl.bindVertexArray(nothing);
        gl.drawArrays(gl.TRIANGLES, 0, 3);
        gl.depthFunc(gl.LESS);
        gl.useProgram(lines.program);
        gl.uniformMatrix4fv(lines.at.clip_from_eye, false, clip);
        for (const { shape, tint } of outlines) {
          gl.uniform4fv(lines.at.tint, tint);
          gl.bindVertexArray(shape.vertices);
          gl.drawArrays(gl.LINES, 0, shape.count);
        }
        gl.bindVertexArray(null);
      },
    };
  };

  /** The edges of a camera's pyramid, `depth` long, as pairs of points from the eye. */
  const pyramid = (pose, half, depth, eye) => {
    const from_eye = (p) => in_world(pose, p, 1).map((value, axis) => value - eye[axis]);
    const corners = [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([x, y]) => from_eye([x * half[0] * depth, y * half[1] * depth, depth]));
    const tip = from_eye([0, 0, 0]), edges = [];
    for (let i = 0; i < 4; ++i) edges.push(...tip, ...corners[i], ...corners[i], ...corners[(i + 1) % 4]);
    return edges;
  };

  // -------------------------------------------------------------------------------------------------- the view

  const modes = [["colour", "colour"], ["ao", "AO"], ["confidence", "confidence"], ["shaded", "colour × AO"], ["normal", "normal"]];

  scanshade.point_view = ({ rows, head }) => {
    const canvas = by_id("point-canvas"), stage = by_id("point-stage"), source_select = by_id("point-source"), colour_select = by_id("point-colour");
    const posed = rows.filter((row) => row.pose);
    const stem_of = (each) => each?.file("points", ".000.js")?.slice(0, -7);
    const tiles = rows.filter((each) => stem_of(each) && !each.pose); // clouds of one system, as files have it
    const camera = scanshade.camera();
    scanshade.shown_camera = () => camera;
    scanshade.shown_box = () => box;
    let painter = null, shown = false, row = null, chunks = [], outlines = [], box = null, facing = [0, 0, 0], loading = 0, source = null, said = "", moving = false, rest = 0, drawn_ms = 0;

    for (const [key, label] of modes) colour_select.append(make("option", { value: key, selected: key === "shaded" }, label));

    // What can be shown for a row. `key` stays the same where changing the frame needs no new points.
    const sources_of = (each) => {
      const sources = [];
      if (stem_of(each)) sources.push({ key: `cloud ${each.index}`, label: "cloud", load: (take) => load_chunks(stem_of(each), take) });
      if (head.recording_points) sources.push({ key: "recording", label: "recording, merged", world: true, load: (take) => load_chunks(head.recording_points, take) });
      if (each?.file("previews", ".js")) sources.push({ key: `frame ${each.index}`, label: "this frame", world: Boolean(each.pose), load: (take) => load_frames([each], 1, take) });
      if (tiles.length > 1) sources.push({ key: "clouds", label: "all clouds", load: (take) => load_clouds(tiles, take) });
      if (posed.length > 1 && posed[0].file("previews", ".js")) sources.push({ key: "together", label: "frames together", world: true, load: (take) => load_frames(spread(posed, 24), 2, take) });
      return sources;
    };
    const spread = (all, most) => (all.length <= most ? all : Array.from({ length: most }, (_, i) => all[Math.round(i * (all.length - 1) / (most - 1))]));

    /** Chunk after chunk: points/NAME.000.js and on. `take` returns false once the chunks are wanted no more. */
    const load_chunks = async (stem, take, most = Infinity) => {
      for (let part = 0, parts = 1; part < Math.min(parts, most); ++part) {
        const data = await scanshade.load(`${stem}.${String(part).padStart(3, "0")}.js`);
        parts = data.parts;
        const facts = { total: data.total, of: data.of, up: data.up, left_out: data.left_out };
        const chunk = await opened_chunk(data);
        chunk.spacing = 2 * data.spacing || 0.01; // neighbours on the curve are nearer than the points' spacing
        if (!take(chunk, facts)) return false;
      }
      return true;
    };
    /** An even sample of each cloud, a million points in all. */
    const load_clouds = async (some, take) => {
      const sums = { of: 0, left_out: 0 }, each_most = Math.max(1, Math.floor(10 / some.length));
      for (const each of spread(some, 64)) {
        const before = { ...sums };
        const wanted = await load_chunks(stem_of(each), (chunk, facts) => {
          for (const sum of Object.keys(sums)) sums[sum] = before[sum] + facts[sum];
          return take(chunk, { ...facts, ...sums });
        }, each_most);
        if (!wanted) return;
      }
    };
    const load_frames = async (some, stride, take) => {
      for (const each of some) {
        const preview = await scanshade.preview_of(each);
        if (!preview?.z_m || !preview.camera) continue;
        const chunk = await chunk_of_preview(preview, each.pose, stride);
        // A pixel covers more the farther away it is; slanted surfaces lie wider apart.
        chunk.slope = 1.3 * stride * preview.step / preview.camera[0];
        if (!take(chunk, {})) return;
      }
    };

    const grow_box = ({ positions, origin }) => {
      const step = 3 * Math.max(1, Math.floor(positions.length / 3 / 20000)), axes = [[], [], []];
      for (let i = 0; i < positions.length; i += step) for (let axis = 0; axis < 3; ++axis) axes[axis].push(origin[axis] + positions[i + axis]);
      for (const values of axes) values.sort((a, b) => a - b);
      const at = (share) => axes.map((values) => values[Math.floor(share * (values.length - 1))] ?? 0);
      const low = at(0.01), high = at(0.99);
      box = box ? [box[0].map((v, i) => Math.min(v, low[i])), box[1].map((v, i) => Math.max(v, high[i]))] : [low, high];
    };

    const clear = () => {
      for (const chunk of chunks) painter.release(chunk);
      chunks = [];
      box = null;
      facing = [0, 0, 0];
    };

    const mean_normal = (chunk) => {
      const sum = [0, 0, 0], normals = new Int8Array(chunk.more.buffer);
      for (let i = 0; i < chunk.count; ++i) for (let axis = 0; axis < 3; ++axis) sum[axis] += normals[4 * i + 1 + axis];
      return sum.map((value) => value / (127 * Math.max(1, chunk.count)));
    };

    const tell = () => {
      const count = chunks.reduce((sum, chunk) => sum + chunk.count, 0);
      by_id("point-readout").textContent = said || `${count.toLocaleString("en")} points${source?.of > count ? ` of ${source.of.toLocaleString("en")}` : ""}${source?.left_out ? `, ${source.left_out} far away left out` : ""}${loading ? ", loading" : ""}`;
    };

    const take_source = (next) => {
      if (!painter || source?.key === next?.key) return;
      const number = ++loading_number, keep_view = source?.world && next?.world;
      clear();
      source = next && { ...next };
      said = "";
      by_id("point-empty").hidden = Boolean(next);
      if (!next) {
        by_id("point-empty").textContent = "this frame has no points: it has no preview, or was not computed";
        draw();
        return tell();
      }
      loading = 1;
      next.load((chunk, facts) => {
        if (number !== loading_number) return false;
        if (chunk.count === 0) return true;
        if (chunks.length === 0) {
          if (facts.up) camera.up = facts.up;
          if (chunk.has.sides) facing = mean_normal(chunk);
        }
        source.of = facts.of;
        source.left_out = facts.left_out;
        grow_box(chunk);
        chunks.push(painter.upload(chunk));
        if (chunks.length === 1) {
          offer_modes(chunk.has);
          by_id("point-backs").parentElement.hidden = !chunk.has.sides;
        }
        if (!keep_view && (chunks.length === 1 || next.key === "clouds")) home(false);
        draw();
        tell();
        return true;
      }).catch((failure) => { if (number === loading_number) said = failure.message; }).finally(() => {
        if (number !== loading_number) return;
        loading = 0;
        if (chunks.length === 0 && !said) said = "no points";
        canvas.dataset.loaded = source.key;
        tell();
        draw();
      });
    };
    let loading_number = 0;

    const offer_modes = (has) => {
      const usable = { colour: true, ao: has.ao, confidence: has.confidence, shaded: has.ao, normal: has.normal };
      for (const option of colour_select.options) option.disabled = !usable[option.value];
      if (colour_select.selectedOptions[0]?.disabled) colour_select.value = has.ao ? "shaded" : "colour";
    };

    // ------------------------------------------------------------------------------------------------ cameras

    const view_of = (each, preview) => {
      const pose = source?.world && each.pose ? each.pose : [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0];
      const axis = (i) => [pose[i], pose[4 + i], pose[8 + i]];
      const centre = box ? box[0].map((value, i) => (value + box[1][i]) / 2) : [0, 0, 1];
      const eye = axis(3), forward = axis(2);
      const along = centre.reduce((sum, value, i) => sum + (value - eye[i]) * forward[i], 0);
      const half = preview?.camera ? preview.whole[1] / (2 * preview.camera[1]) : Math.tan(25 * Math.PI / 180);
      return { eye, right: axis(0), down: axis(1), forward, distance: Math.max(along, 0.05), half_height: half };
    };
    /** To the frame's own camera, or before the whole cloud. */
    const home = async (flying = true) => {
      camera.stop();
      const number = loading_number;
      const preview = row ? await scanshade.preview_of(row).catch(() => null) : null;
      if (number !== loading_number) return;
      if (preview?.camera && !source?.key.startsWith("cloud")) {
        if (row.pose && source?.world) camera.up = [-row.pose[1], -row.pose[5], -row.pose[9]];
        else camera.up = [0, -1, 0];
        const view = view_of(row, preview);
        if (flying) camera.fly_to(view, draw);
        else Object.assign(camera, view);
      } else if (box) camera.frame_box(...box, facing);
      draw();
    };
    const draw_cameras = () => {
      for (const { shape } of outlines) painter.release(shape);
      outlines = [];
      if (!source?.world || posed.length === 0 || !box) return;
      const preview = current_preview, half = preview?.camera ? [preview.whole[0] / (2 * preview.camera[0]), preview.whole[1] / (2 * preview.camera[1])] : [0.5, 0.4];
      const depth = 0.025 * Math.hypot(...box[1].map((value, i) => value - box[0][i]));
      // Cameras close to the eye would fill the picture with their edges.
      const apart = (each) => Math.hypot(...[3, 7, 11].map((at, axis) => each.pose[at] - camera.eye[axis]));
      const others = spread(posed, 200).filter((each) => each !== row && apart(each) > 4 * depth).flatMap((each) => pyramid(each.pose, half, depth, camera.eye));
      if (others.length) outlines.push({ shape: painter.upload_lines(new Float32Array(others)), tint: [0.55, 0.6, 0.66, 1] });
      if (row?.pose && apart(row) > 2 * depth) outlines.push({ shape: painter.upload_lines(new Float32Array(pyramid(row.pose, half, 1.6 * depth, camera.eye))), tint: [1, 0.75, 0.2, 1] });
    };
    let current_preview = null;

    // ------------------------------------------------------------------------------------------------ pictures

    const value = (id) => Number(by_id(id).value);
    const render = () => {
      if (!shown || !painter || canvas.clientWidth === 0) return;
      const scale = Math.min(devicePixelRatio || 1, 2), width = Math.round(canvas.clientWidth * scale), height = Math.round(canvas.clientHeight * scale);
      if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
      const reach = box ? Math.hypot(...box[1].map((v, i) => v - box[0][i])) : 1;
      const away = box ? Math.hypot(...box[0].map((v, i) => (v + box[1][i]) / 2 - camera.eye[i])) : 1;
      const far = 3 * reach + away, near = far / 20000;
      // While the view moves, only as many chunks as were drawn in time: each prefix is an even sample.
      const busy = moving && drawn_ms > 60 && chunks.length > 1;
      const some = busy ? chunks.slice(0, Math.max(1, Math.floor(chunks.length * 60 / drawn_ms))) : chunks;
      const began = performance.now();
      draw_cameras();
      painter.draw(some, outlines, camera, {
        near, far, size: value("point-size") / 3, strength: value("point-strength"),
        clip_low: Math.min(value("clip-low"), value("clip-high")), clip_high: Math.max(value("clip-low"), value("clip-high")),
        mode: modes.findIndex(([key]) => key === colour_select.value), edges: by_id("point-edl").checked, backs: by_id("point-backs").checked, background: [0.08, 0.09, 0.105],
      });
      if (!busy && chunks.length > 1) painter.when_done(() => { drawn_ms = performance.now() - began; });
      canvas.dataset.drawn = String(Number(canvas.dataset.drawn || 0) + 1);
      if (!moving) return;
      clearTimeout(rest);
      rest = setTimeout(() => { moving = false; draw(); }, 200);
    };
    const draw = scanshade.once_per_picture(render);
    const moved = () => { moving = true; clearTimeout(rest); camera.stop(); draw(); };

    // ------------------------------------------------------------------------------------------------ hands

    const pointers = new Map();
    canvas.addEventListener("pointerdown", (event) => {
      pointers.set(event.pointerId, [event.clientX, event.clientY]);
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", (event) => {
      const before = pointers.get(event.pointerId);
      if (!before) return;
      const now = [event.clientX, event.clientY], height = canvas.clientHeight;
      const right = (now[0] - before[0]) / height, down = (now[1] - before[1]) / height;
      if (pointers.size === 2) {
        const other = [...pointers.entries()].find(([id]) => id !== event.pointerId)[1];
        const length = (a) => Math.max(1, Math.hypot(a[0] - other[0], a[1] - other[1]));
        camera.zoom(length(now) / length(before));
        camera.pan(right / 2, down / 2);
      } else if (event.buttons & 6 || event.shiftKey) camera.pan(right, down);
      else camera.orbit(-3 * right, 3 * down);
      pointers.set(event.pointerId, now);
      moved();
    });
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (event) => pointers.delete(event.pointerId));
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("wheel", (event) => {
      camera.zoom(Math.exp(-event.deltaY / 500));
      moved();
      event.preventDefault();
    }, { passive: false });
    canvas.addEventListener("dblclick", () => home());
    canvas.addEventListener("keydown", (event) => {
      const turn = { ArrowLeft: [0.08, 0], ArrowRight: [-0.08, 0], ArrowUp: [0, -0.08], ArrowDown: [0, 0.08] }[event.key];
      if (!turn) return;
      if (event.shiftKey) camera.pan(turn[0], turn[1]);
      else camera.orbit(...turn);
      moved();
      event.preventDefault();
      event.stopPropagation();
    });
    for (const id of ["point-strength", "point-size", "point-edl", "point-backs", "clip-low", "clip-high"]) by_id(id).addEventListener("input", draw);
    colour_select.addEventListener("change", draw);
    by_id("point-home").addEventListener("click", () => home());
    source_select.addEventListener("change", () => {
      wanted_label = source_select.selectedOptions[0].textContent;
      take_source(sources_of(row).find((each) => each.key === source_select.value));
    });
    new ResizeObserver(draw).observe(canvas);

    let wanted_label = "";
    const offer_sources = () => {
      const sources = sources_of(row), chosen = sources.find((each) => each.label === wanted_label) || sources[0];
      source_select.replaceChildren(...sources.map((each) => make("option", { value: each.key, selected: each === chosen }, each.label)));
      source_select.disabled = sources.length === 0;
      take_source(chosen);
    };

    const start = () => {
      if (painter) return;
      try {
        painter = painter_of(canvas);
      } catch (failure) {
        said = failure.message;
      }
      if (!painter) {
        by_id("point-empty").hidden = false;
        by_id("point-empty").textContent = "This browser shows no points: it has no WebGL 2, or it is switched off. All else works.";
        return;
      }
      canvas.addEventListener("webglcontextlost", () => {
        by_id("point-empty").hidden = false;
        by_id("point-empty").textContent = "The graphics device was lost. Loading the page again brings the points back.";
      });
    };

    return {
      camera,
      select(next) {
        row = next;
        if (!shown) return;
        const before = source?.key;
        scanshade.preview_of(next).catch(() => null).then((found) => {
          if (row !== next) return;
          current_preview = found;
          offer_sources();
          if (source && source.key === before) home();
          else draw();
        });
      },
      show(wanted) {
        shown = wanted;
        if (!wanted) return;
        start();
        if (painter && row) this.select(row);
        tell();
      },
      key(event) {
        if (event.key === "+" || event.key === "=") camera.zoom(1.25);
        else if (event.key === "-") camera.zoom(0.8);
        else if (event.key === "0") { home(); return true; }
        else return false;
        moved();
        return true;
      },
    };
  };
}
