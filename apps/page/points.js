// The view of points: what is shown of a row, the camera and the hands that move it, and the controls around the picture.
"use strict";
{
  const { by_id, make, in_world, spread, link } = scanshade;

  /** The edges of a camera's pyramid, `depth` long, as pairs of points from the eye. */
  const pyramid = (pose, half, depth, eye) => {
    const from_eye = (p) => in_world(pose, p, 1).map((value, axis) => value - eye[axis]);
    const corners = [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([x, y]) => from_eye([x * half[0] * depth, y * half[1] * depth, depth]));
    const tip = from_eye([0, 0, 0]), edges = [];
    for (let i = 0; i < 4; ++i) edges.push(...tip, ...corners[i], ...corners[i], ...corners[(i + 1) % 4]);
    return edges;
  };

  scanshade.point_view = ({ rows, head }) => {
    const canvas = by_id("point-canvas"), stage = by_id("point-stage"), source_select = by_id("point-source");
    const posed = rows.filter((row) => row.pose), sources_of = scanshade.point_sources({ rows, head });
    const camera = scanshade.camera(), picked = scanshade.picked_points(stage);
    scanshade.shown_camera = () => camera;
    scanshade.shown_box = () => box;
    scanshade.shown_chunks = () => in_picture;
    let painter = null, shown = false, row = null, source = null, loading = 0, said = "";
    let chunks = [], in_picture = [], outlines = [], box = null, sample = [], facing = [0, 0, 0];
    let moving = false, moves = 0, drawn_ms = 0, drawn_points = 0, asked_view = link.camera();
    const most_drawn = 1.5e6, least_drawn = 1e5;

    const grow_box = ({ positions, origin }) => {
      const step = 3 * Math.max(1, Math.floor(positions.length / 3 / 20000)), axes = [[], [], []];
      for (let i = 0; i < positions.length; i += step) for (let axis = 0; axis < 3; ++axis) axes[axis].push(origin[axis] + positions[i + axis]);
      for (const values of axes) values.sort((a, b) => a - b);
      const at = (share) => axes.map((values) => values[Math.floor(share * (values.length - 1))] ?? 0);
      const low = at(0.01), high = at(0.99);
      for (let i = 0; i < positions.length; i += 20 * step) sample.push([0, 1, 2].map((axis) => origin[axis] + positions[i + axis]));
      box = box ? [box[0].map((v, i) => Math.min(v, low[i])), box[1].map((v, i) => Math.max(v, high[i]))] : [low, high];
    };

    const clear = () => {
      for (const chunk of chunks) {
        painter.release(chunk.shape);
        chunk.shape = null;
      }
      chunks = [];
      in_picture = [];
      trees.clear();
      box = null;
      sample = [];
      picked.clear();
      facing = [0, 0, 0];
    };

    const mean_normal = (chunk) => {
      const sum = [0, 0, 0], normals = new Int8Array(chunk.more.buffer);
      for (let i = 0; i < chunk.count; ++i) for (let axis = 0; axis < 3; ++axis) sum[axis] += normals[4 * i + 1 + axis];
      return sum.map((value) => value / (127 * Math.max(1, chunk.count)));
    };

    const in_all = (some) => some.reduce((sum, chunk) => sum + chunk.count, 0);
    const tell = () => {
      const words = (value) => value.toLocaleString("en"), count = source?.total ?? in_all(chunks), drawn = in_all(in_picture);
      const of = source?.of > count ? ` of ${words(source.of)}` : "", left_out = source?.left_out ? `, ${source.left_out} far away left out` : "";
      const waits = loading || !trees.is_settled(), part = trees.is_open() && drawn < count ? `, ${words(drawn)} in this view` : "";
      const text = said || `${words(count)} points${of}${left_out}${part}${waits ? ", loading" : ""}`, readout = by_id("point-readout");
      if (readout.textContent !== text) readout.textContent = text;
    };
    /** More points of an open cloud. */
    const take = (chunk) => {
      chunk.shape = painter.upload(chunk);
      chunks.push(chunk);
      return colours.take(chunk);
    };
    const drop = (chunk) => {
      painter.release(chunk.shape);
      chunk.shape = null;
      chunks.splice(chunks.indexOf(chunk), 1);
    };
    const trees = scanshade.octrees({ take, drop, changed: () => draw(), failed: (failure) => { said = failure.message; } });

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
      delete canvas.dataset.loaded;
      let offered = null;
      const use = (chunk, facts) => {
        if (number !== loading_number) return false;
        if (chunk.count === 0) return true;
        for (const sum of ["total", "of", "left_out"]) if (sum in facts) source[sum] = (source[sum] || 0) + facts[sum];
        chunk.shape = painter.upload(chunk);
        chunks.push(chunk);
        grow_box(chunk);
        clip.fit(box);
        if (chunks.length === 1) {
          if (facts.up) camera.up = facts.up;
          if (chunk.has.sides) facing = mean_normal(chunk);
          by_id("point-backs").parentElement.hidden = !chunk.has.sides;
          // Rooms are opened, by their inner sides. What mostly faces one way, as terrain does, would only get holes.
          by_id("point-backs").checked = Math.hypot(...facing) > 0.3;
          offered = colours.offer(chunk, camera.up.map((value) => value / Math.hypot(...camera.up)));
        } else offered = offered.then(() => (number === loading_number ? colours.take(chunk) : null)).then(draw);
        if (!keep_view && (chunks.length === 1 || next.key === "clouds")) home(false);
        draw();
        tell();
        return true;
      };
      (next.stems ? trees.open(next.stems, use) : next.load(use)).then(() => offered).catch((failure) => { if (number === loading_number) said = failure.message; }).finally(() => {
        if (number !== loading_number) return;
        loading = 0;
        if (chunks.length === 0 && !said) said = "no points";
        if (chunks.length === 0) canvas.dataset.loaded = source.key;
        tell();
        draw();
      });
    };
    let loading_number = 0;

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
      seen_row = row;
      camera.stop();
      if (asked_view) {
        Object.assign(camera, asked_view);
        if (!loading || source?.key !== "clouds") asked_view = null;
        return draw();
      }
      const number = loading_number;
      const preview = row ? await scanshade.preview_of(row).catch(() => null) : null;
      if (number !== loading_number) return;
      if (preview?.camera && !source?.key.startsWith("cloud")) {
        if (row.pose && source?.world) camera.up = [-row.pose[1], -row.pose[5], -row.pose[9]];
        else camera.up = [0, -1, 0];
        const view = view_of(row, preview);
        if (flying) camera.fly_to(view, draw);
        else Object.assign(camera, view);
      } else if (box) camera.frame_box(...box, facing, sample, canvas.clientWidth / Math.max(1, canvas.clientHeight));
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
    let current_preview = null, seen_row = null; // the row that the view was last set for

    // ------------------------------------------------------------------------------------------------ pictures

    const value = (id) => Number(by_id(id).value);
    const put_link = () => {
      if (!shown || !source || chunks.length === 0) return;
      const seen = { eye: camera.eye, forward: camera.forward, down: camera.down, distance: [camera.distance], half: [camera.half_height] };
      link.put("points", "points&" + scanshade.words([["show", source.key], ...colours.words(), ["size", value("point-size")], ...clip.words(),
        ...Object.entries(seen).map(([name, values]) => [name, values.map((each) => Number(each.toPrecision(12)))])]));
    };
    const render = () => {
      if (!shown || !painter || canvas.clientWidth === 0) return;
      const scale = Math.min(devicePixelRatio || 1, 2), width = Math.round(canvas.clientWidth * scale), height = Math.round(canvas.clientHeight * scale);
      if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
      const reach = box ? Math.hypot(...box[1].map((v, i) => v - box[0][i])) : 1;
      const away = box ? Math.hypot(...box[0].map((v, i) => (v + box[1][i]) / 2 - camera.eye[i])) : 1;
      const far = 3 * reach + away, near = far / 20000;
      // While the view moves, only as many points as were drawn in time.
      const busy = moving && drawn_ms > 60 && drawn_points > 0, share = busy ? 60 / drawn_ms : 1;
      if (trees.is_open()) in_picture = trees.choose(camera, [width, height], clip.corners(), busy ? Math.max(least_drawn, drawn_points * share) : most_drawn, !busy);
      else in_picture = chunks.slice(0, Math.max(1, Math.floor(chunks.length * share)));
      const began = performance.now();
      draw_cameras();
      // A part of the frames' points stands farther apart than all of them.
      const scarce = trees.is_open() ? 1 : Math.sqrt(in_all(chunks) / Math.max(1, in_all(in_picture)));
      painter.draw(in_picture, outlines, camera, {
        near, far, size: scarce * value("point-size") / 3, ...colours.look(), clip: clip.corners(),
        edges: by_id("point-edl").checked, backs: by_id("point-backs").checked, background: [0.08, 0.09, 0.105],
      });
      picked.draw_marks(camera);
      put_link();
      if (!busy) {
        const count = in_all(in_picture);
        painter.when_done(() => { [drawn_ms, drawn_points] = [performance.now() - began, count]; });
        if (!loading && source && trees.is_settled()) canvas.dataset.loaded = source.key;
        tell();
      }
      canvas.dataset.drawn = String(Number(canvas.dataset.drawn || 0) + 1);
      if (!moving) return;
      // All points come once the view rests: a while after the device is done, which on a slow one is long after the call.
      const until = moves;
      painter.when_done(() => setTimeout(() => {
        if (until !== moves || !moving) return;
        moving = false;
        draw();
      }, 200));
    };
    const draw = scanshade.once_per_picture(render);
    const colours = scanshade.colour_control({ chunks: () => chunks, clouds: trees.clouds, changed: draw }), clip = scanshade.clip_control(draw);
    if (link.numbers("size", 1)) by_id("point-size").value = link.numbers("size", 1)[0];
    const moved = () => { moving = true; ++moves; delete canvas.dataset.loaded; camera.stop(); draw(); };

    // ------------------------------------------------------------------------------------------------ hands

    const pick = async ([x, y]) => {
      const edge = canvas.getBoundingClientRect(), limits = clip.corners(), fronts_only = !by_id("point-backs").checked;
      const hidden = ({ positions, origin, more, has }, i, from_eye) => {
        const place = [0, 1, 2].map((axis) => origin[axis] + positions[3 * i + axis]);
        if (limits && place.some((value, axis) => value < limits[0][axis] || value > limits[1][axis])) return true;
        return fronts_only && has.sides && from_eye.reduce((sum, value, axis) => sum + value * (more[4 * i + 1 + axis] << 24 >> 24), 0) > 0;
      };
      await picked.take(scanshade.point_at(in_picture, camera, [x - edge.left, y - edge.top], [edge.width, edge.height], hidden));
      draw();
    };

    const pointers = new Map();
    let pressed = null; // where, until it moves: a click picks a point
    canvas.addEventListener("pointerdown", (event) => {
      pressed = pointers.size === 0 && event.button === 0 ? [event.clientX, event.clientY] : null;
      pointers.set(event.pointerId, [event.clientX, event.clientY]);
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", (event) => {
      const before = pointers.get(event.pointerId);
      if (!before) return;
      const now = [event.clientX, event.clientY], height = canvas.clientHeight;
      if (pressed && Math.hypot(now[0] - pressed[0], now[1] - pressed[1]) < 4) return;
      pressed = null;
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
    canvas.addEventListener("pointerup", () => { if (pressed) pick(pressed); });
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
    for (const id of ["point-size", "point-edl", "point-backs"]) by_id(id).addEventListener("input", draw);
    by_id("picked-clear").addEventListener("click", draw);
    // The picture as it is drawn, at once, since the device keeps none.
    by_id("point-png").addEventListener("click", () => {
      render();
      canvas.toBlob((blob) => {
        const address = URL.createObjectURL(blob);
        make("a", { href: address, download: `${row.name}.png` }).click();
        setTimeout(() => URL.revokeObjectURL(address), 1000);
      });
    });
    by_id("point-home").addEventListener("click", () => home());
    source_select.addEventListener("change", () => {
      wanted_label = source_select.selectedOptions[0].textContent;
      take_source(sources_of(row).find((each) => each.key === source_select.value));
    });
    new ResizeObserver(draw).observe(canvas);

    let wanted_label = "", wanted_key = link.text("show");
    const offer_sources = () => {
      const sources = sources_of(row), chosen = sources.find((each) => each.key === wanted_key) || sources.find((each) => each.label === wanted_label) || sources[0];
      wanted_key = null;
      source_select.replaceChildren(...sources.map((each) => make("option", { value: each.key, selected: each === chosen }, each.label)));
      source_select.parentElement.hidden = sources.length < 2;
      take_source(chosen);
    };

    const start = () => {
      if (painter) return;
      try {
        painter = scanshade.painter(canvas);
      } catch (failure) {
        said = failure.message;
      }
      if (!painter) {
        by_id("point-empty").hidden = false;
        by_id("point-empty").textContent = "This browser shows no points: it has no WebGL 2, or it is switched off. All else works.";
        return;
      }
      colours.use(painter);
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
          if (source && source.key === before && seen_row !== next) home(); // another frame of the same points
          else draw();
        });
      },
      show(wanted) {
        shown = wanted;
        if (!wanted) return link.put("points", "");
        start();
        if (painter && row) this.select(row);
        tell();
      },
      key(event) {
        if (event.key === "+" || event.key === "=") camera.zoom(1.25);
        else if (event.key === "-") camera.zoom(0.8);
        else if (event.key === "0") { home(); return true; }
        else if (event.key === "Escape") picked.clear();
        else return false;
        moved();
        return true;
      },
    };
  };
}
