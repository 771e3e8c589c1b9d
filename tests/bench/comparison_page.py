"""The page of compare_methods.py: one file with a table to sort, plots of error against time, and pictures side by side.

Looks come from apps/page/ (head.html, style.css, document.css). Names and messages enter by html.escape only.
"""

import base64
import hashlib
import math
from html import escape
from pathlib import Path

PAGES = Path(__file__).resolve().parents[2] / "apps/page"

SORT = """
for (const table of document.querySelectorAll("table.sorted"))
  table.querySelectorAll("th").forEach((head, column) => {
    const button = document.createElement("button");
    button.type = "button";
    button.append(...head.childNodes);
    head.append(button);
    button.addEventListener("click", () => {
      const falling = head.getAttribute("aria-sort") === "ascending";
      table.querySelectorAll("th").forEach((other) => other.removeAttribute("aria-sort"));
      head.setAttribute("aria-sort", falling ? "descending" : "ascending");
      const body = table.tBodies[0];
      const value = (row) => {
        const cell = row.cells[column];
        return "v" in cell.dataset ? (cell.dataset.v === "" ? NaN : Number(cell.dataset.v)) : cell.textContent;
      };
      const order = (a, b) => {
        const x = value(a), y = value(b);
        if (typeof x === "string") return x.localeCompare(y) * (falling ? -1 : 1);
        if (Number.isNaN(x) || Number.isNaN(y)) return Number.isNaN(x) - Number.isNaN(y);
        return falling ? y - x : x - y;
      };
      body.append(...[...body.rows].sort(order));
    });
  });
"""

STYLE = """
.document { max-width: 1400px; }
.document th button { border: 0; background: none; padding: 0; font: inherit; font-weight: 600; min-height: 0; text-align: inherit; }
.document th[aria-sort="ascending"] button::after { content: " \\2191"; }
.document th[aria-sort="descending"] button::after { content: " \\2193"; }
.document th { position: sticky; top: 0; background: var(--paper); }
.document .wide { max-height: 80vh; overflow: auto; }
.document td:first-child { white-space: nowrap; }
.two { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 560px), 1fr)); gap: 18px 28px; }
.document .views { display: grid; grid-template-columns: repeat(auto-fill, minmax(160px, 1fr)); gap: 10px; }
.document .views figure { margin: 0; }
.document .views figure img { width: 100%; height: auto; }
.document .views img + img { margin-top: 3px; }
.two svg { max-width: 760px; }
.document .legend-of-differences img { width: 260px; height: 14px; }
"""


# ------------------------------------------------------------------------------------------------- plots

WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 620, 330, 50, 150, 30, 44


def ticks_of(low, high):
    """Round steps, four or so, within low .. high."""
    step = 10 ** math.floor(math.log10((high - low) / 4))
    step *= next(f for f in (1, 2, 5, 10) if f * step >= (high - low) / 5)
    return [i * step for i in range(math.ceil(low / step), math.floor(high / step) + 1)]


def mark(x, y, kind, label):
    """A dot for the first eight methods, a square for the next eight, then a triangle."""
    shape = [f'<circle class="dot" cx="{x:.1f}" cy="{y:.1f}" r="4">',
             f'<rect class="dot" x="{x - 3.6:.1f}" y="{y - 3.6:.1f}" width="7.2" height="7.2">',
             f'<path class="dot" d="M{x:.1f} {y - 5:.1f} l5 9 h-10 z">'][min(kind // 8, 2)]
    return f"{shape}<title>{escape(label)}</title></{shape[1:].split()[0]}>"


def plot(rows, device, heading, methods):
    """Error with the curve against time. A line joins the qualities of one profile, lowest to highest."""
    points = {}
    for row in rows:
        ms, error = row["ms"].get(device), row["held_out_rms"]
        if ms and error is not None:
            points.setdefault(row["method"], []).append((ms, error, row["name"]))
    if not points:
        return ""
    every = [p for of_method in points.values() for p in of_method]
    low, high = min(p[0] for p in every) / 1.2, max(p[0] for p in every) * 1.2
    least, most = min(p[1] for p in every) - 0.005, max(p[1] for p in every) + 0.005
    x_of = lambda ms: LEFT + (WIDTH - LEFT - RIGHT) * math.log(ms / low) / math.log(high / low)
    y_of = lambda error: HEIGHT - BOTTOM - (HEIGHT - TOP - BOTTOM) * (error - least) / (most - least)
    lines = [f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{escape(heading)}">',
             f'<text class="title" x="{LEFT}" y="18">{escape(heading)}</text>']
    for tick in ticks_of(least, most):
        y = y_of(tick)
        lines.append(f'<line class="grid" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y:.1f}" y2="{y:.1f}"/>'
                     f'<text x="{LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{tick:.2f}</text>')
    for decade in range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1):
        for ms in (10**decade, 2 * 10**decade, 5 * 10**decade):
            if low <= ms <= high:
                lines.append(f'<line class="grid" x1="{x_of(ms):.1f}" x2="{x_of(ms):.1f}" y1="{TOP}" y2="{HEIGHT - BOTTOM}"/>'
                             f'<text x="{x_of(ms):.1f}" y="{HEIGHT - BOTTOM + 16}" text-anchor="middle">{ms:g}</text>')
    lines.append(f'<text x="{(LEFT + WIDTH - RIGHT) / 2:.0f}" y="{HEIGHT - 6}" text-anchor="middle">'
                 "device milliseconds a frame (median), logarithmic</text>")
    for kind, method in enumerate(methods):
        of_method = points.get(method, [])
        if not of_method:
            continue
        profiles = {}
        for ms, error, name in of_method:
            profiles.setdefault(name.partition(" ")[2], []).append(f"{x_of(ms):.1f},{y_of(error):.1f}")
        path = "".join(f'<polyline class="line" opacity="0.35" points="{" ".join(p)}"/>' for p in profiles.values())
        marks = "".join(mark(x_of(ms), y_of(error), kind, f"{method} {name}: {ms:.3g} ms, RMSE {error:.4f}")
                        for ms, error, name in of_method)
        y = TOP + 8 + 17 * kind
        lines.append(f'<g class="series-{kind % 8}">{path}{marks}'
                     f'{mark(WIDTH - RIGHT + 18, y, kind, method)}</g>'
                     f'<text x="{WIDTH - RIGHT + 29}" y="{y + 4}">{escape(method)}</text>')
    return "\n".join(lines + ["</svg>"])


# ------------------------------------------------------------------------------------------------- the table


def number_cell(value, digits, sign=""):
    if value is None:
        return '<td data-v="">-</td>'
    return f'<td data-v="{value!r}">{value:{sign}.{digits}f}</td>'


def table(rows, devices, short_name):
    places = list(rows[0]["place"])
    heads = ["method and quality", "RMSE", "with curve", "bias", "SSIM", "corr.", *places, *(f"ms, {short_name(d)}" for d in devices)]
    lines = ['<div class="wide" tabindex="0" role="region" aria-label="Table"><table class="sorted"><thead><tr>']
    lines.append("".join(f'<th scope="col">{escape(h)}</th>' for h in heads) + "</tr></thead><tbody>")
    for row in rows:
        why = f' title="{escape(row["why"])}"' if row["why"] else ""
        cells = [f'<td{why}>{escape(row["method"])} {escape(row["name"])}{" (failed)" if why else ""}</td>',
                 number_cell(row["rms"], 4), number_cell(row["held_out_rms"], 4), number_cell(row["bias"], 4, "+"),
                 number_cell(row["ssim"], 3), number_cell(row["correlation"], 3)]
        cells += [number_cell(row["place"][p][3], 3) for p in places]
        cells += [number_cell(row["ms"].get(d), 2) for d in devices]
        lines.append("<tr>" + "".join(cells) + "</tr>")
    return "\n".join(lines + ["</tbody></table></div>"])


# ------------------------------------------------------------------------------------------------- pictures


def picture(folder, name, alternative):
    """The picture inside the page; a name that leads out of the report's folder is left out."""
    path = (folder / name).resolve()
    if not name or not path.is_relative_to(folder.resolve()) or not path.is_file():
        return f'<p class="quiet">no picture of {escape(alternative)}</p>'
    data = base64.b64encode(path.read_bytes()).decode()
    return f'<img alt="{escape(alternative)}" loading="lazy" src="data:image/jpeg;base64,{data}">'


def chosen_captures(captures, count):
    """Each sensor's in turns, of another scene each time."""
    by_sensor = {}
    for capture in captures:
        by_sensor.setdefault(capture["sensor"], []).append(capture)
    groups, chosen = list(by_sensor.values()), []
    for i in range(count):
        group = groups[i % len(groups)]
        candidate = group[i % len(group)]
        if candidate not in chosen:
            chosen.append(candidate)
    return chosen


def shown(configurations):
    """Each method at medium, or as it comes; then the profiles at medium."""
    methods = {}
    for row in configurations:
        methods.setdefault(row["method"], []).append(row)
    rows = []
    for of_method in methods.values():
        medium = [row for row in of_method if row["name"] == "medium" or row["name"].startswith("medium, ")]
        rows += medium or of_method[:1]
    return rows


def views(report, folder, count):
    html = []
    for capture in chosen_captures(report["captures"], count):
        name = f"{capture['name']}, {capture['sensor']}"
        figures = [f"<figure>{picture(folder, capture.get('picture', ''), f'truth of {name}')}<figcaption>truth</figcaption></figure>"]
        for row in shown(capture["configurations"]):
            title = f"{row['method']} {row['name']}"
            rms = row["difference"]["rms"]
            caption = f"{title}, RMSE {rms:.4f}" if rms is not None else f"{title}: {row.get('why', 'failed')}"
            map_name = row.get("picture", "")
            pictures = picture(folder, map_name, title)
            if map_name:
                pictures += picture(folder, map_name.removesuffix(".jpg") + "-difference.jpg", f"difference of {title} to truth")
            figures.append(f"<figure>{pictures}<figcaption>{escape(caption)}</figcaption></figure>")
        html.append(f"<h3>{escape(name)}</h3>\n" + '<div class="views">\n' + "\n".join(figures) + "\n</div>")
    scale = picture(folder, "pictures/scale.jpg", "Scale of differences: blue -0.5, white 0, red +0.5")
    return ('<figure class="legend-of-differences">' + scale +
            "<figcaption>Differences to truth: -0.5 (too dark) .. 0 .. +0.5 (too bright)</figcaption></figure>\n" + "\n".join(html))


# ------------------------------------------------------------------------------------------------- the page


def policy_hash(text):
    """A script or style as a Content-Security-Policy names it: nothing else runs, whatever data contain."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def section(heading, html):
    return f"<section><h2>{escape(heading)}</h2>\n{html}\n</section>"


def page(result, report, folder, view_count):
    """The whole document. `report` is the bench.json in `folder` whose pictures are shown."""
    from compare_methods import SENSORS, short_name, what_was_measured  # the caller; here, since it imports this file

    devices = [d["name"] for d in result["devices"]]
    methods = list(dict.fromkeys(row["method"] for row in result["rows"]))
    sensors = [s for s in SENSORS if any(row["sensor"] == s for row in result["rows"])]
    of_sensor = {s: [row for row in result["rows"] if row["sensor"] == s] for s in sensors}
    about = [what_was_measured(result)]
    about += [f"{d['name']}: {d['driver']}; each configuration timed {d['rounds']}x on each frame, in turns." for d in result["devices"]]
    about += ["RMSE is that of the method as it comes. With curve: the tone curve that is best for the other captures of the "
              "same sensor, judged on the one left out. Errors by place are with the curve.",
              "Each pixel has one place, the first that fits: thin things (under 4 cm), deep corners (truth below 0.2), near holes "
              "(4 pixels), near depth edges (8 pixels), open and flat (truth from 0.95 on), between them."]
    plots = "".join(plot(of_sensor[s], d, f"{s[0].upper()}{s[1:]} depth, {short_name(d)}", methods) for s in sensors for d in devices)
    sections = [section("What was measured", "\n".join(f"<p>{escape(line)}</p>" for line in about)),
                section("Error against time", f"<p>Error with the curve. Pointing at a mark names it.</p>\n<div class=\"two\">{plots}</div>")]
    sections += [section(f"{s[0].upper()}{s[1:]} depth", table(of_sensor[s], devices, short_name)) for s in sensors]
    sections.append(section("Pictures", "<p>The first view. Above the method's visibility, below its difference to truth.</p>\n" +
                            views(report, folder, view_count)))
    style = (PAGES / "style.css").read_text() + (PAGES / "document.css").read_text() + STYLE
    policy = f"default-src 'none'; script-src {policy_hash(SORT)}; style-src {policy_hash(style)}; img-src data:; base-uri 'none'; form-action 'none'"
    title = "Ambient occlusion: all methods against truth"
    head = (PAGES / "head.html").read_text()
    for mark, text in {"title": title, "policy": policy, "styles": f"<style>{style}</style>\n"}.items():
        head = head.replace("{{" + mark + "}}", text)
    return f"""{head}<body class="document">
<header class="top">
<p class="brand">scanshade {escape(result["measured"]["version"])}</p>
<h1>{title}</h1>
</header>
<main>
{chr(10).join(sections)}
</main>
<script>{SORT}</script>
</body>
</html>
"""
