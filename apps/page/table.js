// A table of any number of rows: only those in sight are in the document. Sorted by any column, filtered by text.
"use strict";
{
  const { make } = scanshade;

  /**
   * columns: {key, label, value(row), text(row), numeric, kind(row), title, picture(row)}. `row_height`: px. `worst` gives the order of the first look:
   * smaller is worse. Returns {show(rows), select(row), step(by), sort_worst(), order()}.
   */
  scanshade.table = (place, { columns, label, worst, on_select, on_open, id_of, row_height = 30 }) => {
    place.style.setProperty("--row", `${row_height}px`);
    let rows = [], shown = [], selected = null, sorted_by = null, falling = false, test = () => true;

    const head = make("tr");
    const body = make("tbody");
    const table = make("table", { role: "grid", "aria-label": label }, make("thead", {}, head), body);
    const above = make("tr", { "aria-hidden": "true", class: "gap" }, make("td", { colspan: columns.length }));
    const below = make("tr", { "aria-hidden": "true", class: "gap" }, make("td", { colspan: columns.length }));
    place.append(table);

    for (const column of columns) {
      const button = make("button", { type: "button", title: column.title || "", onclick: () => sort(column) }, column.label);
      column.head = make("th", { scope: "col", class: column.numeric ? "number" : "" }, button);
      head.append(column.head);
    }

    const compare = (a, b) => {
      const x = sorted_by ? sorted_by.value(a) : worst(a), y = sorted_by ? sorted_by.value(b) : worst(b);
      const unknown_x = x === null || Number.isNaN(x), unknown_y = y === null || Number.isNaN(y);
      if (unknown_x || unknown_y) return unknown_x - unknown_y; // last, whichever way the others go
      const order = typeof x === "string" ? x.localeCompare(y, undefined, { numeric: true }) : x - y;
      return sorted_by && falling ? -order : order;
    };

    const arrange = () => {
      shown = rows.filter(test).map((row, i) => [row, i]).sort((a, b) => compare(a[0], b[0]) || a[1] - b[1]).map((pair) => pair[0]);
      for (const column of columns)
        column.head.setAttribute("aria-sort", column === sorted_by ? (falling ? "descending" : "ascending") : "none");
      table.setAttribute("aria-rowcount", shown.length + 1);
      place.scrollTop = 0;
      drawn_from = -1;
      draw();
    };

    const sort = (column) => {
      falling = column === sorted_by ? !falling : false;
      sorted_by = column;
      arrange();
    };

    let drawn_from = -1, drawn_to = -1;
    const draw = () => {
      const room = Math.ceil(place.clientHeight / row_height) + 1;
      const from = Math.max(0, Math.min(Math.floor(place.scrollTop / row_height) - 6, shown.length - room));
      const to = Math.min(shown.length, from + room + 12);
      if (from === drawn_from && to === drawn_to) return;
      drawn_from = from;
      drawn_to = to;
      above.firstChild.style.height = from * row_height + "px";
      below.firstChild.style.height = (shown.length - to) * row_height + "px";
      body.replaceChildren(above, ...shown.slice(from, to).map((row, i) => {
        const line = make("tr", { "aria-rowindex": from + i + 2, "aria-selected": String(row === selected), "data-row": id_of(row) });
        for (const column of columns) {
          const text = column.text ? column.text(row) : String(column.value(row));
          const cell = make("td", { class: (column.numeric ? "number " : "") + (column.kind ? column.kind(row) : "") });
          if (column.picture?.(row)) cell.append(make("img", { src: column.picture(row), alt: "", loading: "lazy" }));
          else if (column.link && column.link(row)) cell.append(make("a", { href: column.link(row) }, text));
          else cell.append(text);
          line.append(cell);
        }
        line.addEventListener("click", () => { select(row); on_select(row); });
        return line;
      }), below);
    };
    place.addEventListener("scroll", scanshade.once_per_picture(draw));
    new ResizeObserver(() => { drawn_from = -1; draw(); }).observe(place);

    const bring_to_sight = (index) => {
      const head_height = head.offsetHeight, top = index * row_height, low = place.scrollTop, high = low + place.clientHeight - head_height;
      if (top < low) place.scrollTop = top;
      else if (top + row_height > high) place.scrollTop = top + row_height - (high - low);
    };

    const select = (row) => {
      selected = row;
      const index = shown.indexOf(row);
      if (index >= 0) bring_to_sight(index);
      drawn_from = -1;
      draw();
    };

    const step = (by) => {
      if (shown.length === 0) return;
      const index = shown.indexOf(selected);
      const row = shown[Math.max(0, Math.min(shown.length - 1, index < 0 ? 0 : index + by))];
      select(row);
      on_select(row);
    };

    place.addEventListener("keydown", (event) => {
      const page = Math.max(1, Math.floor(place.clientHeight / row_height) - 2);
      const by = { ArrowUp: -1, ArrowDown: 1, PageUp: -page, PageDown: page, Home: -shown.length, End: shown.length }[event.key];
      if (event.key === "Enter" && selected && on_open) on_open(selected);
      if (by === undefined) return;
      step(by);
      event.preventDefault();
      event.stopPropagation();
    });

    return {
      show(all, which) { rows = all; test = which || test; arrange(); return shown.length; },
      filter(which) { test = which; arrange(); return shown.length; },
      sort_worst() { sorted_by = null; arrange(); },
      order: () => shown,
      select, step,
    };
  };
}
