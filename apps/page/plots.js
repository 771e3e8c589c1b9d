// Lines over the frames of a recording. A column of pixels shows the least and the most of its frames, so that one odd
// frame among ten thousand stays in sight.
"use strict";
{
  const { svg, make, fixed } = scanshade;
  const width = 640, height = 190, left = 44, right = 10, top = 12, bottom = 22;

  /** Round steps within low .. high. */
  const ticks = (low, high, wanted) => {
    const rough = (high - low) / wanted, decade = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 5, 10].map((factor) => factor * decade).find((size) => size >= rough * 0.999);
    const found = [];
    for (let i = Math.ceil(low / step - 1e-9); i * step <= high + step * 1e-9; ++i) found.push(i * step);
    return { found, digits: Math.max(0, -Math.floor(Math.log10(step) + 1e-9)) };
  };

  /**
   * series: [{name, value(row)}]; limits: [low, high], either may be null: from the data. Calls on_pick(index) for a
   * click. Returns {mark(index)}.
   */
  scanshade.plot = (place, { title, unit, rows, series, limits, on_pick }) => {
    let least = Infinity, most = -Infinity;
    const values = series.map((line) => rows.map((row) => {
      const value = line.value(row);
      if (Number.isFinite(value)) { least = Math.min(least, value); most = Math.max(most, value); }
      return value;
    }));
    const known = most >= least;
    let low = limits[0] ?? (known ? least : 0), high = limits[1] ?? (known ? most : 1);
    if (!(high > low)) { low -= 0.5; high += 0.5; }
    if (limits[1] === null) high += 0.05 * (high - low);
    const x_of = (index) => left + (width - left - right) * (rows.length > 1 ? index / (rows.length - 1) : 0.5);
    const y_of = (value) => height - bottom - (height - top - bottom) * (value - low) / (high - low);

    const figure = make("figure", { class: "plot" });
    const name = make("figcaption", {}, make("strong", {}, title), unit ? ` ${unit}` : "");
    const said = make("span", { class: "quiet" });
    name.append(said);
    const drawing = svg("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": `${title} over the frames` });
    const { found, digits } = ticks(low, high, 4);
    for (const tick of found) {
      drawing.append(svg("line", { x1: left, x2: width - right, y1: y_of(tick), y2: y_of(tick), class: "grid" }));
      const text = svg("text", { x: left - 6, y: y_of(tick) + 4, "text-anchor": "end" });
      text.textContent = tick.toFixed(digits);
      drawing.append(text);
    }
    if (rows.length > 1)
      for (const tick of ticks(0, rows.length - 1, 6).found.filter(Number.isInteger)) {
        const text = svg("text", { x: x_of(tick), y: height - 6, "text-anchor": "middle" });
        text.textContent = tick;
        drawing.append(text);
      }

    const columns = Math.min(rows.length, width - left - right);
    series.forEach((line, k) => {
      let path = "", open = false;
      for (let column = 0; column < columns; ++column) {
        const from = Math.floor(column * rows.length / columns), to = Math.max(from + 1, Math.floor((column + 1) * rows.length / columns));
        let lowest = Infinity, highest = -Infinity, at_low = from, at_high = from;
        for (let i = from; i < to; ++i) {
          const value = values[k][i];
          if (!Number.isFinite(value)) continue;
          if (value < lowest) { lowest = value; at_low = i; }
          if (value > highest) { highest = value; at_high = i; }
        }
        if (lowest > highest) { open = false; continue; }
        const points = at_low === at_high ? [[at_low, lowest]]
          : at_low < at_high ? [[at_low, lowest], [at_high, highest]] : [[at_high, highest], [at_low, lowest]];
        for (const [index, value] of points) {
          path += `${open ? "L" : "M"}${x_of(index).toFixed(1)} ${y_of(value).toFixed(1)}`;
          open = true;
        }
      }
      drawing.append(svg("path", { d: path, class: `line series-${k}` }));
      if (rows.length < 60)
        values[k].forEach((value, i) => {
          if (Number.isFinite(value)) drawing.append(svg("circle", { cx: x_of(i), cy: y_of(value), r: 2.5, class: `dot series-${k}` }));
        });
    });
    const cursor = svg("line", { y1: top, y2: height - bottom, class: "cursor", visibility: "hidden" });
    const mark = svg("line", { y1: top, y2: height - bottom, class: "mark", visibility: "hidden" });
    drawing.append(cursor, mark);
    if (series.length > 1)
      name.append(make("span", { class: "names" }, ...series.map((line, k) => make("span", { class: `name series-${k}` }, line.name))));
    figure.append(name, drawing);
    place.append(figure);

    const index_at = (event) => {
      const box = drawing.getBoundingClientRect();
      const x = (event.clientX - box.left) * width / box.width;
      return Math.max(0, Math.min(rows.length - 1, Math.round((x - left) / (width - left - right) * (rows.length - 1))));
    };
    const put = (line, index) => {
      line.setAttribute("x1", x_of(index));
      line.setAttribute("x2", x_of(index));
      line.setAttribute("visibility", "visible");
    };
    drawing.addEventListener("pointermove", (event) => {
      const index = index_at(event);
      put(cursor, index);
      said.textContent = `  ${rows[index].name}: ${values.map((each) => fixed(each[index], digits + 1)).join(", ")}`;
    });
    drawing.addEventListener("pointerleave", () => {
      cursor.setAttribute("visibility", "hidden");
      said.textContent = "";
    });
    drawing.addEventListener("click", (event) => on_pick(index_at(event)));
    return { mark: (index) => put(mark, index) };
  };
}
