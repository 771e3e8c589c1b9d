// The page of several captures: one row each, with a link to its own page.
"use strict";
scanshade.parts.push(() => {
  const { by_id, make, fixed, address, head } = scanshade;
  const rows = scanshade.rows.map(([name, frames, ok, doubtful, failed, left, coverage, visibility, ms, page, picture]) =>
    ({ name, frames, ok, doubtful, failed, left, coverage: coverage ?? NaN, visibility: visibility ?? NaN, ms: ms ?? NaN, page, picture }));

  by_id("version").textContent = head.version;
  by_id("title").textContent = head.title;
  document.title = `${head.title} · scanshade`;
  by_id("subtitle").textContent = head.subtitle;
  for (const [name, value] of head.facts) by_id("facts").append(make("div", {}, make("dt", {}, name), make("dd", {}, value)));
  for (const note of head.notes) by_id("notes").append(make("li", {}, note));
  by_id("notes").parentElement.hidden = head.notes.length === 0;
  for (const [kind, count, reason, first] of head.reasons)
    by_id("reason-list").append(make("li", {}, make("span", { class: `group ${kind}` }, `${count} × ${kind}`), ` ${reason}`, make("span", { class: "quiet" }, ` (first: ${first})`)));
  by_id("reasons").hidden = head.reasons.length === 0;

  const count = (key, label) => ({ key, label, numeric: true, value: (row) => row[key], kind: (row) => (row[key] > 0 ? `status ${key}` : "quiet") });
  const number = (key, label, digits, title) => ({ key, label, title, numeric: true, value: (row) => row[key], text: (row) => fixed(row[key], digits) });
  const table = scanshade.table(by_id("rows"), {
    label: "Captures",
    row_height: 56,
    columns: [
      { key: "picture", label: "picture", value: (row) => row.name, text: () => "", kind: () => "picture", picture: (row) => row.picture && address(row.picture) },
      { key: "name", label: "capture", value: (row) => row.name, link: (row) => (row.page ? address(row.page) : null) },
      { key: "frames", label: "frames", numeric: true, value: (row) => row.frames },
      count("ok", "ok"), count("doubtful", "doubtful"), count("failed", "failed"), count("left", "left"),
      number("coverage", "coverage", 3, "mean over the frames"), number("visibility", "AO", 3, "mean visibility over the frames"),
      number("ms", "ms a frame", 1, "milliseconds in all stages"),
    ],
    worst: (row) => -(row.failed + row.left) * 1e6 - row.doubtful * 1e3 + (Number.isFinite(row.coverage) ? row.coverage : 0),
    on_select: () => {},
    on_open: (row) => { if (row.page) location.href = address(row.page); },
    id_of: (row) => row.name,
  });
  const states = [["all", () => true], ...["failed", "left", "doubtful"].map((state) => [state, (row) => row[state] > 0])];
  let only = states[0][1];
  const narrow = () => {
    const words = by_id("filter").value.toLowerCase().split(/\s+/).filter(Boolean);
    const found = table.filter((row) => only(row) && words.every((word) => row.name.toLowerCase().includes(word)));
    by_id("shown").textContent = found === rows.length ? "" : `${found} of ${rows.length}`;
  };
  const chips = states.map(([state, test]) => [state, test, rows.filter(test).length]).filter(([state, , found]) => state === "all" || found > 0).map(([state, test, found]) => {
    const chip = make("button", { type: "button", class: `chip ${state}`, "aria-pressed": String(state === "all"), onclick: () => {
      only = test;
      for (const other of chips) other.setAttribute("aria-pressed", String(other === chip));
      narrow();
    } }, state === "all" ? `${found} ${found === 1 ? "capture" : "captures"}` : `${found} with frames ${state}`);
    return chip;
  });
  by_id("counts").append(...chips);
  by_id("filter").addEventListener("input", narrow);
  by_id("worst").addEventListener("click", () => table.sort_worst());
  table.show(rows);
  document.documentElement.dataset.ready = "yes"; // for whoever measures
});
