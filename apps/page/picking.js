// Picked points: which one lies under the pointer, its values in a table, marks over the picture, and the distance between the
// last two.
"use strict";
{
  const { by_id, make, svg } = scanshade;
  const reach_px = 6;

  /** The foremost point near a place of the picture (CSS pixels): {chunk, index}, or null. `hidden(chunk, index, place)` leaves points out. */
  scanshade.point_at = (chunks, camera, [x, y], [width, height], hidden) => {
    const { right, down, forward, eye, half_height } = camera, scale = height / (2 * half_height);
    let best = null, least = Infinity;
    for (const chunk of chunks) {
      const from = chunk.origin.map((value, axis) => value - eye[axis]), { positions } = chunk;
      for (let i = 0; i < chunk.count; ++i) {
        const a = from[0] + positions[3 * i], b = from[1] + positions[3 * i + 1], c = from[2] + positions[3 * i + 2];
        const z = forward[0] * a + forward[1] * b + forward[2] * c;
        if (!(z > 0)) continue;
        const off_x = width / 2 + scale * (right[0] * a + right[1] * b + right[2] * c) / z - x;
        const off_y = height / 2 + scale * (down[0] * a + down[1] * b + down[2] * c) / z - y;
        const off = off_x * off_x + off_y * off_y;
        if (off > reach_px * reach_px) continue;
        const score = z * (1 + 0.002 * off); // of points at about one depth the nearest to the pointer
        if (score < least && !hidden(chunk, i, [a, b, c])) [best, least] = [{ chunk, index: i }, score];
      }
    }
    return best;
  };

  /** Everything known of a point, [name, text] each. */
  const values_of = async ({ chunk, index }) => {
    const { paint, more, has, step } = chunk, rows = [];
    const place = [0, 1, 2].map((axis) => chunk.origin[axis] + chunk.positions[3 * index + axis]);
    place.forEach((value, axis) => rows.push(["xyz"[axis], step ? scanshade.in_steps(value, step[axis]) : value.toFixed(4)]));
    if (has.ao) rows.push(["AO", scanshade.fixed(scanshade.share_of(paint[4 * index + 3], 128), 2)]);
    if (has.confidence) rows.push(["confidence", scanshade.fixed(scanshade.share_of(more[4 * index], 32), 2)]);
    if (has.colour) rows.push(["RGB", [...paint.subarray(4 * index, 4 * index + 3)].join(" ")]);
    if (has.normal) rows.push(["normal", [1, 2, 3].map((at) => ((more[4 * index + at] << 24 >> 24) / 127).toFixed(2)).join(" ")]);
    for (const field of chunk.fields) {
      const code = (await field.codes())[index], value = field.low + (code - 1) * field.step, exact = field.whole && field.step <= 1;
      const shown = exact ? String(value) : `${field.whole ? "about " : ""}${scanshade.in_steps(value, field.step)}`;
      rows.push([field.name, code === 0 ? "–" : [shown, scanshade.class_words(field.name, value)].filter(Boolean).join(" ")]);
    }
    if (chunk.more_fields) rows.push([`${chunk.more_fields} more`, "in the file"]);
    return { place, rows };
  };

  /** Keeps the last two points. `draw_marks(camera)` puts the marks where the points are in the picture. */
  scanshade.picked_points = (stage) => {
    const panel = by_id("picked"), marks = by_id("point-marks");
    let points = [];

    const distance = () => Math.hypot(...points[0].place.map((value, axis) => value - points[1].place[axis]));
    const length = (value) => Number(value.toPrecision(5)).toString();
    const tell = () => {
      panel.hidden = points.length === 0;
      if (panel.hidden) return;
      const last = points[points.length - 1], rows = [...last.rows];
      if (points.length === 2) {
        const [before] = points;
        rows.unshift(["distance", length(distance())], ["apart", last.place.map((value, axis) => length(value - before.place[axis])).join(" ")]);
      }
      by_id("picked-values").replaceChildren(...rows.map(([name, text]) => make("tr", {}, make("th", { scope: "row" }, name), make("td", {}, text))));
    };

    const clear = () => {
      points = [];
      tell();
      marks.replaceChildren();
    };
    const draw_marks = (camera) => {
      const width = stage.clientWidth, height = stage.clientHeight, scale = height / (2 * camera.half_height);
      const places = points.map(({ place }) => {
        const from_eye = place.map((value, axis) => value - camera.eye[axis]);
        const along = (axis) => axis.reduce((sum, value, i) => sum + value * from_eye[i], 0), z = along(camera.forward);
        return z > 0 ? [width / 2 + scale * along(camera.right) / z, height / 2 + scale * along(camera.down) / z] : null;
      });
      marks.setAttribute("viewBox", `0 0 ${width} ${height}`);
      marks.replaceChildren();
      if (places.length === 2 && places.every(Boolean)) {
        const [[x1, y1], [x2, y2]] = places;
        marks.append(svg("line", { x1, y1, x2, y2 }));
        const label = svg("text", { x: (x1 + x2) / 2 + 6, y: (y1 + y2) / 2 - 6 });
        label.textContent = length(distance());
        marks.append(label);
      }
      for (const place of places) if (place) marks.append(svg("circle", { cx: place[0], cy: place[1], r: 6 }));
    };
    by_id("picked-clear").addEventListener("click", clear);

    return {
      clear,
      draw_marks,
      async take(found) {
        const last = points[points.length - 1];
        if (!found || (last?.chunk === found.chunk && last.index === found.index)) return;
        points = [...points.slice(-1), { ...found, ...await values_of(found) }];
        tell();
      },
    };
  };
}
