// The camera of the point view: where it stands, and how it turns, moves and flies. x right, y down, z forward.
"use strict";
{
  const add = (a, b, scale = 1) => [a[0] + scale * b[0], a[1] + scale * b[1], a[2] + scale * b[2]];
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const unit = (a) => { const length = Math.hypot(...a) || 1; return a.map((value) => value / length); };

  /** `v` turned about the unit axis (Rodrigues). */
  const turned = (v, axis, angle) => {
    const c = Math.cos(angle), s = Math.sin(angle), along = dot(axis, v) * (1 - c), side = cross(axis, v);
    return [0, 1, 2].map((i) => v[i] * c + side[i] * s + axis[i] * along);
  };

  /** Right-handed axes that look along `forward`, with `down` as far down as can be. */
  const looking = (forward, down) => {
    const f = unit(forward);
    let r = cross(down, f);
    if (Math.hypot(...r) < 1e-6) r = cross(Math.abs(f[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0], f);
    r = unit(r);
    return { right: r, down: cross(f, r), forward: f };
  };

  scanshade.looking = looking;
  scanshade.camera = () => {
    const camera = { eye: [0, 0, 0], ...looking([0, 0, 1], [0, 1, 0]), up: [0, -1, 0], distance: 2, half_height: Math.tan(25 * Math.PI / 180) };
    let flight = 0;

    const target = () => add(camera.eye, camera.forward, camera.distance);
    /** Sets the axes about the target again. */
    const about = (centre) => { camera.eye = add(centre, camera.forward, -camera.distance); };

    return Object.assign(camera, {
      target,
      orbit(right, down) {
        const centre = target();
        for (const axis of ["right", "down", "forward"]) camera[axis] = turned(camera[axis], camera.up, -right);
        for (const axis of ["down", "forward"]) camera[axis] = turned(camera[axis], camera.right, -down);
        about(centre);
      },
      /** Shares of the picture's height. */
      pan(right, down) {
        const scale = 2 * camera.half_height * camera.distance;
        camera.eye = add(add(camera.eye, camera.right, -right * scale), camera.down, -down * scale);
      },
      zoom(factor) {
        const centre = target();
        camera.distance = Math.max(1e-6, camera.distance / factor);
        about(centre);
      },
      /** Before the points of `sample` in the box, which fill the picture, from in front and above; from the side that most of it faces, the mean normal's. */
      frame_box(low, high, facing, sample, aspect) {
        const ahead = Math.abs(camera.up[2]) > 0.5 ? [0.5, 0.8, 0] : [0.3, 0, 0.95];
        Object.assign(camera, looking(add(add(ahead, camera.up, -0.45), facing, -2.5), camera.up.map((value) => -value)));
        camera.half_height = Math.tan(25 * Math.PI / 180);
        const beside = high.map((value, i) => 0.1 * (value - low[i])); // the box leaves out the outermost points, strays or not
        const within = sample.filter((place) => place.every((value, i) => value >= low[i] - beside[i] && value <= high[i] + beside[i])), margin = 0.95, half = camera.half_height;
        let centre = low.map((value, i) => (value + high[i]) / 2);
        camera.distance = 0;
        for (let round = 0; round < 4; ++round) { // the centre of what is seen depends on the distance
          const places = within.map((place) => [camera.right, camera.down, camera.forward].map((axis) => dot(axis, add(place, centre, -1))));
          camera.distance = places.reduce((most, [x, y, z]) => Math.max(most, Math.abs(x) / (margin * half * aspect) - z, Math.abs(y) / (margin * half) - z), 0) || 1;
          const middle = (at) => {
            const shares = places.map((place) => place[at] / Math.max(1e-9, camera.distance + place[2]));
            return camera.distance * (Math.min(...shares) + Math.max(...shares)) / 2;
          };
          if (round < 3 && places.length > 0) centre = add(add(centre, camera.right, middle(0)), camera.down, middle(1));
        }
        about(centre);
      },
      /** To a place with axes and angle of view; at once where people ask for less motion. */
      fly_to({ eye, right, down, forward, distance, half_height }, draw) {
        const from = { ...camera }, number = ++flight, began = performance.now();
        const ms = matchMedia("(prefers-reduced-motion: reduce)").matches ? 0 : 600;
        const step = () => {
          if (number !== flight) return;
          const t = ms > 0 ? Math.min(1, (performance.now() - began) / ms) : 1, s = t * t * (3 - 2 * t);
          const between = (a, b) => a.map((value, i) => value + s * (b[i] - value));
          camera.eye = between(from.eye, eye);
          camera.half_height = from.half_height + s * (half_height - from.half_height);
          camera.distance = from.distance + s * (distance - from.distance);
          if (t < 1) Object.assign(camera, looking(between(from.forward, forward), between(from.down, down)));
          else Object.assign(camera, { right, down, forward });
          draw();
          if (t < 1) requestAnimationFrame(step);
        };
        step();
      },
      stop() { ++flight; },
      /** Of points from the eye. Column by column, for WebGL: depth from `near` to `far`, y up on the screen. */
      matrix(aspect, near, far) {
        const { right, down, forward } = camera, y = 1 / camera.half_height, x = y / aspect;
        const a = (far + near) / (far - near), b = -2 * far * near / (far - near);
        const rows = [
          [x * right[0], x * right[1], x * right[2], 0],
          [-y * down[0], -y * down[1], -y * down[2], 0],
          [a * forward[0], a * forward[1], a * forward[2], b],
          [forward[0], forward[1], forward[2], 0],
        ];
        return new Float32Array([0, 1, 2, 3].flatMap((column) => rows.map((row) => row[column])));
      },
    });
  };
}
