// Draws chunks of points and lines with WebGL 2. Places are floats from each chunk's origin; the device gets the origin from
// the eye, so that coordinates of a map keep their digits.
"use strict";
{

  const point_vertex = `#version 300 es
    layout(location = 0) in vec3 position;
    layout(location = 1) in vec4 paint;
    layout(location = 2) in vec3 normal;
    layout(location = 3) in float code; // of the number that colours the point; 0 = none
    uniform mat4 clip_from_eye;
    uniform vec3 origin, low, high; // the origin from the eye; the clipping box from the origin
    uniform float pixels_per_radian, spacing, slope, size, strength;
    uniform vec2 range; // codes of the two ends of the ramp
    uniform int base; // 0: own colour, 1: ramp, 2: normal
    uniform bool has_colour, fronts_only;
    uniform highp sampler2D ramp;
    out vec3 shown;
    float linear(float v) { return v <= 0.04045 ? v / 12.92 : pow((v + 0.055) / 1.055, 2.4); }
    float coded(float v) { return v <= 0.0031308 ? 12.92 * v : 1.055 * pow(v, 1.0 / 2.4) - 0.055; }
    void main() {
      vec3 from_eye = origin + position;
      gl_Position = clip_from_eye * vec4(from_eye, 1.0);
      gl_PointSize = clamp(size * (spacing + slope * length(position)) * pixels_per_radian / max(gl_Position.w, 1e-6), 1.5, 128.0);
      bool has_normal = dot(normal, normal) > 0.1;
      // A room seen from outside opens where its walls' backs would be.
      if (fronts_only && has_normal && dot(normal, from_eye) > 0.0) gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
      if (any(lessThan(position, low)) || any(greaterThan(position, high))) gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
      float ao = floor(paint.a * 255.0 + 0.5), stored = code * 65535.0;
      float open = ao > 0.5 ? mix(1.0, (ao - 1.0) / 127.0, strength) : 1.0;
      float lit = has_normal ? 0.35 + 0.5 * abs(dot(normalize(normal), normalize(from_eye))) : 0.75;
      vec3 colour = has_colour ? paint.rgb : vec3(lit);
      if (base == 2) colour = 0.5 + 0.5 * normal;
      else if (base == 1) {
        float share = clamp((stored - range.x) / max(range.y - range.x, 1e-6), 0.0, 1.0);
        colour = stored > 0.5 ? texelFetch(ramp, ivec2(int(share * 255.0 + 0.5), 0), 0).rgb : vec3(0.11, 0.16, 0.25);
      }
      shown = vec3(coded(linear(colour.r) * open), coded(linear(colour.g) * open), coded(linear(colour.b) * open));
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
  scanshade.painter = (canvas) => {
    const gl = canvas.getContext("webgl2", { antialias: false, alpha: false, powerPreference: "high-performance" });
    if (!gl) return null;
    const points = program_of(gl, point_vertex, point_fragment), screen = program_of(gl, screen_vertex, screen_fragment), lines = program_of(gl, line_vertex, line_fragment);
    const nothing = gl.createVertexArray(), target = gl.createFramebuffer();
    let picture = null, depths = null, size = [0, 0], ramp = null;
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
        gl.vertexAttribPointer(2, 3, gl.BYTE, true, 4, 1);
        gl.bindVertexArray(null);
        return { vertices, buffers: [position, paint, more] };
      },
      /** The numbers that colour a chunk's points, 16 bits each, in place of those before. */
      upload_codes(shape, codes) {
        gl.bindVertexArray(shape.vertices);
        gl.deleteBuffer(shape.buffers[3] || null);
        shape.buffers[3] = buffer_of(codes);
        gl.enableVertexAttribArray(3);
        gl.vertexAttribPointer(3, 1, gl.UNSIGNED_SHORT, true, 0, 0);
        gl.bindVertexArray(null);
      },
      /** 256 colours, [red, green, blue] each. */
      set_ramp(colours) {
        gl.deleteTexture(ramp);
        ramp = texture(gl.RGBA8, 256, 1);
        gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, 256, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(colours.flatMap((colour) => [...colour, 255])));
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
      /** look: near, far, size, strength, base, edges, backs, background; clip: two corners. A chunk's range is in its own codes; ranges: its parts {first, count, spacing}. */
      draw(chunks, outlines, camera, look) {
        fit_targets();
        const { near, far, clip } = look, clip_from_eye = camera.matrix(canvas.width / canvas.height, near, far);
        const from = (place, other) => place.map((value, axis) => value - other[axis]);
        gl.viewport(0, 0, canvas.width, canvas.height);
        gl.bindFramebuffer(gl.FRAMEBUFFER, target);
        gl.enable(gl.DEPTH_TEST);
        gl.depthFunc(gl.LESS);
        gl.clearColor(0, 0, 0, 1);
        gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
        gl.useProgram(points.program);
        gl.uniformMatrix4fv(points.at.clip_from_eye, false, clip_from_eye);
        gl.uniform1f(points.at.pixels_per_radian, canvas.height / (2 * camera.half_height));
        gl.uniform1f(points.at.size, look.size);
        gl.uniform1f(points.at.strength, look.strength);
        gl.uniform1i(points.at.base, look.base);
        gl.activeTexture(gl.TEXTURE2);
        gl.bindTexture(gl.TEXTURE_2D, ramp);
        gl.uniform1i(points.at.ramp, 2);
        for (const chunk of chunks) {
          gl.uniform1i(points.at.has_colour, chunk.has.colour ? 1 : 0);
          gl.uniform1f(points.at.slope, chunk.slope || 0);
          gl.uniform1i(points.at.fronts_only, chunk.has.sides && !look.backs ? 1 : 0);
          gl.uniform2fv(points.at.range, chunk.range || [0, 1]);
          gl.uniform3fv(points.at.origin, from(chunk.origin, camera.eye));
          gl.uniform3fv(points.at.low, clip ? from(clip[0], chunk.origin) : [-1e30, -1e30, -1e30]);
          gl.uniform3fv(points.at.high, clip ? from(clip[1], chunk.origin) : [1e30, 1e30, 1e30]);
          gl.bindVertexArray(chunk.shape.vertices);
          for (const { first, count, spacing } of chunk.ranges || [{ first: 0, count: chunk.count, spacing: 0 }]) {
            gl.uniform1f(points.at.spacing, spacing);
            gl.drawArrays(gl.POINTS, first, count);
          }
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
        gl.uniformMatrix4fv(lines.at.clip_from_eye, false, clip_from_eye);
        for (const { shape, tint } of outlines) {
          gl.uniform4fv(lines.at.tint, tint);
          gl.bindVertexArray(shape.vertices);
          gl.drawArrays(gl.LINES, 0, shape.count);
        }
        gl.bindVertexArray(null);
      },
    };
  };

}
