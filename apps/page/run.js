// The page of a run or of a comparison: its head, and the parts joined. The last script of all.
"use strict";
scanshade.parts.push(() => {
  const { by_id, make, fixed, duration, address, link, head } = scanshade;
  const statuses = ["failed", "skipped", "doubtful", "ok"];
  const marks = { ok: "●", doubtful: "▲", failed: "✕", skipped: "–" };
  const stages = ["load", "project", "compute", "attach", "write"];
  const of_errors = head.kind === "compare";

  /** A row of index.js as names. File sets are shared: {folder: extension}. */
  const rows = scanshade.rows.map((each) => {
    const [index, name, status, why, fault, width, height, valid, coverage, visibility, ms, warnings, notes, set, pose, errors] = each;
    const files = head.file_sets[set];
    return {
      index, name, status, why, fault, width, height, valid: valid ?? NaN, coverage: coverage ?? NaN, visibility: visibility ?? NaN,
      ms: stages.map((_, i) => ms?.[i] ?? NaN), warnings, notes, pose, errors: errors || {},
      total: ms ? ms.reduce((sum, value) => sum + (value || 0), 0) : NaN,
      file: (folder, extension) => {
        const found = files.find((file) => file[0] === folder && (!extension || file[1] === extension));
        return found ? `${found[0]}/${name}${found[1]}` : null;
      },
      files,
    };
  });
  rows.forEach((row, i) => { row.position = i; });
  // Clouds without images: their points come first, their pictures beside.
  const is_cloud = (row) => scanshade.has_cloud(row) && !row.file("previews", ".js");
  const of_clouds = rows.length > 0 && rows.every((row) => is_cloud(row) || row.status === "failed") && rows.some(is_cloud), alone = rows.length === 1;
  const points_in = (row) => `${(row.width * row.height).toLocaleString("en")} points`;
  const counted = (count) => (of_clouds && alone ? points_in(rows[0]) : `${count} ${of_clouds ? "cloud" : "frame"}${count === 1 ? "" : "s"}`);

  // -------------------------------------------------------------------------------------------------- the head

  const text = (id, words) => { by_id(id).textContent = words; };
  text("version", head.version);
  text("title", head.title);
  document.title = `${head.title} · scanshade`;
  text("subtitle", head.subtitle);
  for (const [name, value] of head.facts) if (!(alone && name === "frames/s")) by_id("facts").append(make("div", {}, make("dt", {}, name), make("dd", {}, value)));
  // Where frames failed, what can be done about it comes first: warnings of the capture say it, as the terminal does.
  const failed = rows.filter((row) => row.status === "failed"), advice = head.notes.filter((note) => note.startsWith("warning: ")).map((note) => note.slice(9));
  if (failed.length > 0 && head.lead) head.notes.unshift(head.lead);
  const lead = failed.length === 0 ? head.lead || "" : [`${failed.length} of ${rows.length} failed: ${failed[0].why}.`, ...advice,
    "Once the cause is mended, run the command again with --resume --retry; it is below, under Details."].join(" ");
  for (const note of head.notes) by_id("notes").append(make("li", {}, note));
  by_id("notes").parentElement.hidden = head.notes.length === 0;

  by_id("lead").hidden = !lead;
  text("lead", lead);
  const by_status = new Map(statuses.map((status) => [status, rows.filter((row) => row.status === status).length]));
  let only = null;
  const chips = [["all", rows.length], ...by_status].filter(([name, count]) => name === "all" || count > 0).map(([name, count]) => {
    const chip = make("button", { type: "button", class: `chip ${name}`, "aria-pressed": String(name === "all"), onclick: () => {
      only = name === "all" ? null : name;
      for (const other of chips) other.setAttribute("aria-pressed", String(other === chip));
      narrow();
    } }, name === "all" ? counted(count) : `${marks[name]} ${count} ${name}`);
    return chip;
  });
  by_id("counts").append(...chips);

  /** Reasons without numbers and names, so that those of many frames are one. */
  const groups = new Map();
  for (const row of rows) {
    for (const [kind, reason] of [...(row.why ? [[row.status, row.why]] : []), ...row.warnings.map((each) => ["warning", each])]) {
      const key = kind + ": " + reason.split(row.name).join("FRAME").replace(/[0-9]+([.,][0-9]+)*/g, "#");
      const group = groups.get(key) || { kind, reason, rows: [] };
      group.rows.push(row);
      groups.set(key, group);
    }
  }
  const rank = (kind) => ["failed", "skipped", "doubtful", "warning"].indexOf(kind);
  const sorted_groups = [...groups.values()].sort((a, b) => rank(a.kind) - rank(b.kind) || b.rows.length - a.rows.length);
  for (const group of sorted_groups.slice(0, 50))
    by_id("reason-list").append(make("li", {}, make("button", { type: "button", class: `group ${group.kind}`, onclick: () => { go(group.rows[0]); by_id("viewer").scrollIntoView({ block: "nearest" }); } },
      `${group.rows.length} × ${group.kind}`), ` ${group.reason}`, group.rows.length > 1 ? make("span", { class: "quiet" }, ` (first: ${group.rows[0].name})`) : ""));
  if (sorted_groups.length > 50) by_id("reason-list").append(make("li", { class: "quiet" }, `and ${sorted_groups.length - 50} more kinds`));
  by_id("reasons").hidden = sorted_groups.length === 0;

  const sums = stages.map((_, i) => rows.reduce((sum, row) => sum + (row.ms[i] || 0), 0)), all_ms = sums.reduce((a, b) => a + b, 0);
  if (all_ms > 0) {
    by_id("times").append(
      make("div", { class: "share-bar", role: "img", "aria-label": stages.map((stage, i) => `${stage} ${fixed(100 * sums[i] / all_ms, 0)} %`).join(", ") },
        ...stages.map((stage, i) => {
          const part = make("span", { class: `series-${i}` });
          part.style.flexGrow = String(sums[i] / all_ms);
          return part;
        })),
      make("ul", { class: "names" }, ...stages.map((stage, i) => make("li", { class: `name series-${i}` },
        `${stage} ${duration(sums[i])}, ${fixed(100 * sums[i] / all_ms, 1)} %`))));
  } else by_id("times").parentElement.hidden = true;

  const listed = (title, pairs) => make("details", {}, make("summary", {}, title), make("table", { class: "pairs" }, make("tbody", {}, ...pairs.map(([name, value]) =>
    make("tr", {}, make("th", { scope: "row" }, name), make("td", {}, typeof value === "string" ? value : JSON.stringify(value)))))));
  for (const [title, values] of Object.entries(head.details)) by_id("details").append(listed(title, Object.entries(values)));

  // -------------------------------------------------------------------------------------------------- parts

  const worst = (row) => {
    const class_of = row.status === "failed" ? 0 : row.status === "skipped" ? 1 : row.status === "doubtful" ? 2 : row.warnings.length > 0 ? 3 : 4;
    return of_errors ? (class_of < 2 ? class_of : 10 - (row.errors.rmse ?? 0)) : class_of + (Number.isFinite(row.coverage) ? row.coverage : 0) * 0.9;
  };
  const kind = (key, label, get, digits, title) => ({ key, label, numeric: true, title, value: get, text: (row) => fixed(get(row), digits) });
  const columns = [
    { key: "index", label: "#", numeric: true, value: (row) => row.index },
    { key: "name", label: "frame", value: (row) => row.name },
    { key: "status", label: "status", value: (row) => row.status, text: (row) => `${marks[row.status]} ${row.status}`, kind: (row) => `status ${row.status}` },
    ...(of_errors
      ? [["rmse", "RMSE"], ["bias", "bias"], ["mae", "MAE"], ["worst", "worst"], ["ssim", "SSIM"]].map(([key, label]) => kind(key, label, (row) => row.errors[key] ?? NaN, 4))
      : [kind("coverage", "coverage", (row) => row.coverage, 3, "pixels or points with a visibility / those with a depth"),
        kind("valid", "valid", (row) => row.valid, 3, "pixels or points with a depth / all of them"),
        kind("visibility", "AO", (row) => row.visibility, 3, "mean visibility: 1 = open"),
        ...(rows.some((row) => Number.isFinite(row.errors.expected)) ? [kind("expected", "±", (row) => row.errors.expected ?? NaN, 3, "expected error of visibility, RMS over the frame")] : []),
        kind("total", "ms", (row) => row.total, 1, "milliseconds in all stages")]),
    ...(rows.some((row) => row.why || row.warnings.length > 0) ? [{ key: "warnings", label: "said", value: (row) => row.why || row.warnings[0] || "", text: (row) => [row.why, ...row.warnings].filter(Boolean).join(" ") }] : []),
    ...(of_errors ? [] : stages.map((stage, i) => kind(stage, stage, (row) => row.ms[i], 1, `milliseconds: ${stage}`))),
  ];

  let current = null;
  const go = (row) => {
    if (!row || row === current) return;
    current = row;
    text("frame-name", row.name);
    table.select(row);
    frames.select(row, row.position);
    for (const plot of plots) plot.mark(row.position);
    points.select(row);
    const about = by_id("about");
    about.replaceChildren(
      make("p", {}, make("span", { class: `status ${row.status}` }, `${marks[row.status]} ${row.status}`), row.width ? ` · ${is_cloud(row) && row.height === 1 ? points_in(row) : `${row.width} × ${row.height}`}` : "",
        ...(of_errors ? [` · RMSE ${fixed(row.errors.rmse ?? NaN, 4)}`] : [` · coverage ${fixed(row.coverage, 3)} · AO ${fixed(row.visibility, 3)} · ${duration(row.total)}`])),
      ...[row.why, ...row.warnings, ...row.notes].filter(Boolean).map((each) => make("p", { class: "said" }, each)));
    const pictures = is_cloud(row) ? ["shaded", "panel"].map((folder) => row.file(folder, ".png")).filter(Boolean) : [];
    by_id("beside").replaceChildren(...pictures.map((path) => make("a", { href: address(path) }, make("img", { src: address(path), alt: `Two views of ${row.name}, in its colours and as AO` }))));
    by_id("beside").hidden = pictures.length === 0;
    link.put("row", String(row.index));
  };

  const table = scanshade.table(by_id("rows"), { columns, label: "Frames", worst, on_select: go, on_open: () => by_id("viewer").scrollIntoView(), id_of: (row) => row.index });
  const frames = scanshade.frame_view({ on_select: go, first: of_errors ? ["ao", "reference"] : ["colour", "shaded"] });
  const points = scanshade.point_view({ rows, head });
  const plots = [];
  const plot = (title, unit, limits, series) => {
    if (rows.length < 2 || !rows.some((row) => series.some((line) => Number.isFinite(line.value(row))))) return;
    plots.push(scanshade.plot(by_id("plots"), { title, unit, rows, limits, series, on_pick: (index) => go(rows[index]) }));
  };
  if (of_errors) {
    plot("RMSE", "", [0, null], [{ name: "RMSE", value: (row) => row.errors.rmse ?? NaN }]);
    plot("Bias", "above 0: A is brighter", [null, null], [{ name: "bias", value: (row) => row.errors.bias ?? NaN }]);
  } else {
    plot("Mean visibility", "1 = open", [null, null], [{ name: "visibility", value: (row) => row.visibility }]);
    plot("Coverage", "share of valid pixels or points with a value", [null, 1], [{ name: "coverage", value: (row) => row.coverage }]);
    plot("Valid", "share of pixels or points that hold a depth", [null, 1], [{ name: "valid", value: (row) => row.valid }]);
    plot("Time", "milliseconds", [0, null], stages.map((stage, i) => ({ name: stage, value: (row) => row.ms[i] })));
  }
  by_id("plots").parentElement.hidden = plots.length === 0;

  const narrow = () => {
    const words = by_id("filter").value.toLowerCase().split(/\s+/).filter(Boolean);
    const count = table.filter((row) => {
      if (only && row.status !== only) return false;
      const all = `${row.name} ${row.status} ${row.why} ${row.warnings.join(" ")}`.toLowerCase();
      return words.every((word) => all.includes(word));
    });
    text("shown", count === rows.length ? "" : `${count} of ${rows.length}`);
  };
  by_id("filter").addEventListener("input", narrow);
  by_id("worst").addEventListener("click", () => table.sort_worst());

  // -------------------------------------------------------------------------------------------------- switching, keys

  by_id("show-frame").parentElement.hidden = of_errors || failed.length === rows.length; // maps without depth have no points
  if (of_clouds) by_id("show-frame").textContent = "Picture";
  // One row has nothing to go to, to sort or to compare.
  for (const id of ["list", "strip"]) by_id(id).hidden = alone;
  by_id("previous").parentElement.hidden = alone;

  const show_points = (wanted) => {
    by_id("frame-view").hidden = wanted;
    by_id("point-view").hidden = !wanted;
    by_id("show-frame").setAttribute("aria-pressed", String(!wanted));
    by_id("show-points").setAttribute("aria-pressed", String(wanted));
    points.show(wanted);
  };
  by_id("show-frame").addEventListener("click", () => show_points(false));
  by_id("show-points").addEventListener("click", () => show_points(true));
  const beside = (by) => go(rows[Math.max(0, Math.min(rows.length - 1, (current ? current.position : 0) + by))]);
  by_id("previous").addEventListener("click", () => beside(-1));
  by_id("next").addEventListener("click", () => beside(1));
  document.addEventListener("keydown", (event) => {
    const busy = event.target.closest("input, select, textarea");
    if (event.ctrlKey || event.metaKey || event.altKey || (busy && busy.type !== "checkbox")) return;
    if (event.key === "ArrowLeft") beside(-1);
    else if (event.key === "ArrowRight") beside(1);
    else if (event.key === "ArrowUp") table.step(-1);
    else if (event.key === "ArrowDown") table.step(1);
    else if (event.key === "p") show_points(by_id("point-view").hidden);
    else if (event.key === "w") table.sort_worst();
    else if (event.key === "/") by_id("filter").focus();
    else if (by_id("point-view").hidden ? !frames.key(event) : !points.key(event)) return;
    event.preventDefault();
  });

  table.show(rows);
  frames.fill(rows);
  const asked = rows.find((row) => String(row.index) === link.row);
  go(asked || table.order()[0]);
  if (link.has("points") || (current && is_cloud(current))) show_points(true);
  if (rows.length === 0) text("shown", "no frames");
  document.documentElement.dataset.ready = "yes"; // for whoever measures
});
