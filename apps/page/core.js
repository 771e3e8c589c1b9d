// What all parts of a page share. Data arrive as scripts that call functions of `scanshade`, because a page opened from
// disk may load nothing else. Text from data goes into the page by textContent alone, so no name can become markup.
"use strict";
const scanshade = { rows: [], parts: [] };

// Rows and head come from index.js; begin() starts the parts once both are there.
scanshade.add_rows = (rows) => { for (const row of rows) scanshade.rows.push(row); };
scanshade.set_head = (head) => { scanshade.head = head; };
scanshade.begin = () => {
  if (!scanshade.head) {
    const trouble = document.getElementById("trouble");
    trouble.textContent = "index.js is not beside this page, or it is damaged: run again with --resume.";
    trouble.hidden = false;
    return;
  }
  for (const part of scanshade.parts) part();
};

scanshade.by_id = (id) => document.getElementById(id);

/** An element with attributes and children; strings become text. */
scanshade.make = (tag, attributes, ...children) => {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes || {})) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (value === true) element.setAttribute(name, "");
    else if (value !== false && value !== undefined && value !== null) element.setAttribute(name, value);
  }
  for (const child of children) element.append(child);
  return element;
};

scanshade.svg = (tag, attributes) => {
  const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes || {})) element.setAttribute(name, value);
  return element;
};

/** A number with so many digits behind the point; a dash where it is not known. */
scanshade.fixed = (value, digits) => (Number.isFinite(value) ? value.toFixed(digits) : "–");

/** Milliseconds as people read them. */
scanshade.duration = (ms) => {
  if (!Number.isFinite(ms)) return "–";
  if (ms < 1000) return ms.toFixed(ms < 10 ? 1 : 0) + " ms";
  const s = ms / 1000;
  if (s < 120) return s.toFixed(1) + " s";
  const minutes = Math.floor(s / 60), hours = Math.floor(minutes / 60);
  return hours > 0 ? `${hours} h ${minutes % 60} min` : `${minutes} min ${Math.floor(s % 60)} s`;
};

/** The address of a file in the page's folder: every part of its path coded by itself. */
scanshade.address = (path) => path.split("/").map(encodeURIComponent).join("/");

/** Runs a script of the folder; resolves to what it hands to `scanshade.preview` and the like. */
scanshade.load = (path) => new Promise((resolve, reject) => {
  const script = document.createElement("script");
  script.src = scanshade.address(path);
  script.addEventListener("load", () => {
    script.remove();
    "received" in script ? resolve(script.received) : reject(new Error(`${path} holds no data`));
  });
  script.addEventListener("error", () => {
    script.remove();
    reject(new Error(`${path} is missing`));
  });
  document.head.append(script);
});
scanshade.preview = scanshade.points = (data) => { document.currentScript.received = data; };

scanshade.bytes_of = (base64) => {
  const text = atob(base64), bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; ++i) bytes[i] = text.charCodeAt(i);
  return bytes;
};

/** The bytes of a zlib stream in base64. */
scanshade.unpacked = async (base64) => {
  const stream = new Blob([scanshade.bytes_of(base64)]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
};

/** `make`, called at the first call and never again. */
scanshade.once = (make) => {
  let made = null;
  return () => (made ??= make());
};

/** Keeps the latest results of `make`, so that going back and forth loads nothing again. */
scanshade.cache = (most, make) => {
  const kept = new Map();
  return (key) => {
    const found = kept.get(key);
    if (found) {
      kept.delete(key);
      kept.set(key, found);
      return found;
    }
    const made = make(key);
    kept.set(key, made);
    if (kept.size > most) kept.delete(kept.keys().next().value);
    return made;
  };
};

/** Calls `draw` once per picture of the screen, however often it is asked. */
scanshade.once_per_picture = (draw) => {
  let waiting = false;
  return () => {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => { waiting = false; draw(); });
  };
};
