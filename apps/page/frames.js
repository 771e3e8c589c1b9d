// Two images of a frame behind a divider, moved and enlarged together, and the strip of all frames below.
"use strict";
{
  const { by_id, make, fixed, address } = scanshade;

  /** Loads and unpacks a frame's preview; null for frames without one. */
  scanshade.preview_of = scanshade.cache(48, async (row) => {
    const path = row.file("previews", ".js");
    return path ? scanshade.opened_preview(await scanshade.load(path)) : null;
  });

  const image = (source, alt) => make("img", { src: source, alt, draggable: "false" });

  // What a frame can show. `there`: whether it has it; `elements`: what is laid over each other, the last on top with
  // the strength of AO as its opacity where `mixes`.
  const shown_by_page = (path) => path && /\.(png|jpe?g|webp)$/i.test(path);
  const kinds = [
    { key: "colour", label: "colour", there: (row, p) => p?.picture, elements: (row, p) => [image(p.picture, "Colour")],
      note: (row, p) => (p.fits ? "" : "colour is not known to lie on the depth pixels") },
    { key: "depth", label: "depth", there: (row, p) => p?.z_m, elements: (row, p) => [scanshade.painted.depth(p)] },
    { key: "ao", label: "AO", there: (row, p) => shown_by_page(row.file("ao")) || p?.ao,
      elements: (row, p) => [shown_by_page(row.file("ao")) ? image(address(row.file("ao")), "Visibility") : scanshade.painted.ao(p)] },
    { key: "confidence", label: "confidence", there: (row, p) => shown_by_page(row.file("confidence")) || p?.confidence,
      elements: (row, p) => [shown_by_page(row.file("confidence")) ? image(address(row.file("confidence")), "Confidence") : scanshade.painted.confidence(p)] },
    { key: "shaded", label: "shaded", mixes: true, there: (row) => row.file("shaded"),
      elements: (row, p) => {
        const whole = image(address(row.file("shaded")), "Shaded");
        if (p?.fits && p.picture) return [image(p.picture, "Colour"), whole];
        return p?.z_m ? [scanshade.painted.clay(p), whole] : [whole];
      } },
    { key: "panel", label: "panel", there: (row) => row.file("panel"), elements: (row) => [image(address(row.file("panel")), "Panel")] },
    { key: "reference", label: "reference", there: (row, p) => p?.reference, elements: (row, p) => [scanshade.painted.reference(p)] },
    { key: "difference", label: "difference", there: (row, p) => row.file("difference") || (p?.reference && p?.ao),
      elements: (row, p) => [row.file("difference") ? image(address(row.file("difference")), "Difference") : scanshade.painted.difference(p)] },
  ];

  /** Makes the viewer. `on_select(row)` is told of frames picked in the strip. */
  scanshade.frame_view = ({ on_select, first }) => {
    const stage = by_id("stage"), divider = by_id("divider"), strength = by_id("strength"), readout = by_id("readout");
    const sides = { left: first[0], right: first[1] };
    const layers = { left: by_id("layer-left"), right: by_id("layer-right") };
    let row = null, preview = null, split = 0.5, zoom = 1, pan = [0, 0], ratio = 4 / 3;

    const kind_of = (side) => kinds.find((kind) => kind.key === sides[side] && kind.there(row, preview)) || kinds.find((kind) => kind.there(row, preview));

    // ------------------------------------------------------------------------------------------------ drawing

    const place = () => {
      for (const layer of Object.values(layers)) {
        const inside = layer.firstChild;
        if (!inside) continue;
        inside.style.transform = `translate(${pan[0]}px, ${pan[1]}px) scale(${zoom})`;
        inside.classList.toggle("coarse", zoom > 3);
      }
      layers.right.style.clipPath = `inset(0 0 0 ${100 * split}%)`;
      divider.style.left = `${100 * split}%`;
      divider.setAttribute("aria-valuenow", Math.round(100 * split));
    };

    const mix = () => {
      const tops = Object.values(layers).flatMap((layer) => [...layer.querySelectorAll(".mixes")]);
      for (const top of tops) top.style.opacity = strength.value;
      strength.parentElement.hidden = tops.length === 0;
    };

    const fill = (side) => {
      const kind = kind_of(side), select = by_id(side);
      select.replaceChildren(...kinds.filter((each) => each.there(row, preview)).map((each, i) => make("option", { value: each.key, selected: each === kind }, each.label)));
      select.disabled = !kind;
      if (!kind) {
        layers[side].replaceChildren();
        return;
      }
      const elements = kind.elements(row, preview);
      if (kind.mixes && elements.length > 1) elements[elements.length - 1].classList.add("mixes");
      const inside = make("div", { class: "inside" }, ...elements);
      layers[side].replaceChildren(inside);
      layers[side].dataset.kind = kind.key;
      for (const element of elements) {
        if (element.tagName === "CANVAS") {
          element.setAttribute("role", "img");
          element.setAttribute("aria-label", kind.label);
        }
        element.addEventListener("error", () => { tell(`${kind.label}: the file is missing`); });
      }
      measure(elements[elements.length - 1]);
    };

    /** The stage takes the shape of what it shows. */
    const measure = (element) => {
      const take = (width, height) => {
        if (!(width > 0 && height > 0)) return;
        ratio = width / height;
        stage.style.aspectRatio = String(Math.max(0.8, Math.min(2.4, ratio)));
      };
      if (element.tagName === "CANVAS") take(element.width, element.height);
      else element.addEventListener("load", () => take(element.naturalWidth, element.naturalHeight));
    };

    const tell = (text) => { readout.textContent = text; };
    /** Metres; or an arbitrary unit, which may be of any size. */
    const length = (z, digits) => preview.unit ? `${Number(z.toPrecision(3))} ${preview.unit}` : fixed(z, digits) + " m";

    const draw = () => {
      const empty = by_id("empty");
      fill("left");
      fill("right");
      const none = !kind_of("left");
      empty.hidden = !none;
      // One image alone needs neither choice nor divider.
      const one = kinds.filter((kind) => kind.there(row, preview)).length < 2;
      divider.hidden = one;
      by_id("fit").hidden = none;
      for (const side of ["left", "right"]) by_id(side).parentElement.hidden = one;
      if (none) empty.textContent = row.why || "this frame has no images";
      const left = kind_of("left"), right = kind_of("right");
      tell([left, right].map((kind) => (kind?.note && preview ? kind.note(row, preview) : "")).find(Boolean) || "");
      const legend = by_id("legend");
      legend.hidden = !(preview?.z_m && [left, right].some((kind) => kind?.key === "depth"));
      if (!legend.hidden) {
        by_id("near").textContent = length(preview.range[0], 2);
        by_id("far").textContent = length(preview.range[1], 2);
      }
      mix();
      place();
    };

    const ramp = by_id("ramp").getContext("2d");
    scanshade.depth_colours.forEach((colour, i) => {
      ramp.fillStyle = `rgb(${colour.join(",")})`;
      ramp.fillRect(i, 0, 1, 1);
    });

    // ------------------------------------------------------------------------------------------------ moving

    const enlarge = (factor, at) => {
      const box = stage.getBoundingClientRect();
      const [x, y] = at ? [at[0] - box.left, at[1] - box.top] : [box.width / 2, box.height / 2];
      const next = Math.max(1, Math.min(40, zoom * factor)), scale = next / zoom;
      pan = next === 1 ? [0, 0] : [x - (x - pan[0]) * scale, y - (y - pan[1]) * scale];
      zoom = next;
      place();
    };
    const fit = () => { zoom = 1; pan = [0, 0]; place(); };

    const split_at = (share) => {
      split = Math.max(0, Math.min(1, share));
      place();
    };

    const pointers = new Map();
    let dragging = null;
    stage.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      const box = stage.getBoundingClientRect();
      const beside = Math.abs(event.clientX - box.left - split * box.width) < 14;
      pointers.set(event.pointerId, [event.clientX, event.clientY]);
      dragging = pointers.size > 1 ? "pinch" : beside ? "divider" : zoom > 1 ? "pan" : "divider-from-here";
      stage.setPointerCapture(event.pointerId);
      if (dragging.startsWith("divider")) divider.focus({ preventScroll: true });
      if (dragging === "divider-from-here") split_at((event.clientX - box.left) / box.width);
    });
    stage.addEventListener("pointermove", (event) => {
      const before = pointers.get(event.pointerId);
      read(event);
      if (!before) return;
      const box = stage.getBoundingClientRect(), now = [event.clientX, event.clientY];
      if (dragging === "pinch" && pointers.size === 2) {
        const other = [...pointers.entries()].find(([id]) => id !== event.pointerId)[1];
        const length = (a) => Math.hypot(a[0] - other[0], a[1] - other[1]);
        enlarge(length(now) / Math.max(1, length(before)), [(now[0] + other[0]) / 2, (now[1] + other[1]) / 2]);
      } else if (dragging === "pan") {
        pan = [pan[0] + now[0] - before[0], pan[1] + now[1] - before[1]];
        place();
      } else if (dragging && dragging.startsWith("divider")) {
        split_at((event.clientX - box.left) / box.width);
      }
      pointers.set(event.pointerId, now);
    });
    for (const end of ["pointerup", "pointercancel"])
      stage.addEventListener(end, (event) => {
        pointers.delete(event.pointerId);
        if (pointers.size === 0) dragging = null;
      });
    stage.addEventListener("wheel", (event) => {
      enlarge(Math.exp(-event.deltaY / 400), [event.clientX, event.clientY]);
      event.preventDefault();
    }, { passive: false });
    stage.addEventListener("dblclick", fit);
    divider.addEventListener("keydown", (event) => {
      const by = { ArrowLeft: -0.02, ArrowRight: 0.02, Home: -1, End: 1 }[event.key];
      if (by === undefined) return;
      split_at(split + by);
      event.preventDefault();
      event.stopPropagation();
    });
    by_id("fit").addEventListener("click", fit);
    strength.addEventListener("input", mix);
    for (const side of ["left", "right"])
      by_id(side).addEventListener("change", (event) => {
        sides[side] = event.target.value;
        draw();
      });

    // ------------------------------------------------------------------------------------------------ values

    /** The values of the preview's pixel under the pointer. */
    const read = (event) => {
      if (!preview || dragging) return;
      const box = stage.getBoundingClientRect();
      const x = (event.clientX - box.left - pan[0]) / zoom, y = (event.clientY - box.top - pan[1]) / zoom;
      const [width, height] = preview.size, shape = width / height, wide = shape > box.width / box.height;
      const shown = wide ? [box.width, box.width / shape] : [box.height * shape, box.height];
      const u = Math.floor((x - (box.width - shown[0]) / 2) / shown[0] * width);
      const v = Math.floor((y - (box.height - shown[1]) / 2) / shown[1] * height);
      if (u < 0 || v < 0 || u >= width || v >= height) return tell("");
      const i = v * width + u, parts = [`pixel ${preview.first + u * preview.step}, ${preview.first + v * preview.step}`];
      if (preview.z_m) parts.push(preview.z_m[i] > 0 ? `depth ${length(preview.z_m[i], 3)}` : "no depth");
      if (preview.ao) parts.push(preview.ao[i] ? `AO ${fixed(scanshade.share_of(preview.ao[i], 128), 2)}` : "no AO");
      if (preview.reference && preview.reference[i]) parts.push(`reference ${fixed(scanshade.share_of(preview.reference[i], 128), 2)}`);
      if (preview.confidence && preview.confidence[i]) parts.push(`confidence ${fixed(scanshade.share_of(preview.confidence[i], 32), 2)}`);
      tell(parts.join(" · "));
    };

    // ------------------------------------------------------------------------------------------------ the strip

    const strip = by_id("strip"), inside = by_id("strip-inside"), thumb_width = 92;
    const thumbs = new Map();
    let rows = [];
    const thumb = (index) => {
      const each = rows[index];
      const option = make("button", { type: "button", tabindex: "-1", class: `thumb ${each.status}`, title: each.name, onclick: () => on_select(each) });
      option.style.left = `${index * thumb_width}px`;
      const label = each.name.length > 13 ? "…" + each.name.slice(-12) : each.name; // ends differ where names are long
      const fill_in = (element) => option.replaceChildren(element, make("span", { "aria-hidden": "true" }, label), make("span", { class: "hidden" }, `${each.name}, ${each.status}`));
      fill_in(make("div", { class: "blank" }));
      scanshade.preview_of(each).then((found) => {
        if (found?.ao) fill_in(scanshade.painted.ao(found));
        else {
          const path = [row_picture(each, "shaded"), row_picture(each, "ao"), row_picture(each, "difference")].find(Boolean);
          if (path) fill_in(make("img", { src: address(path), alt: "", loading: "lazy" }));
        }
      }).catch(() => {});
      return option;
    };
    const row_picture = (each, kind) => (shown_by_page(each.file(kind)) ? each.file(kind) : null);
    const draw_strip = () => {
      const from = Math.max(0, Math.floor(strip.scrollLeft / thumb_width) - 2), to = Math.min(rows.length, Math.ceil((strip.scrollLeft + strip.clientWidth) / thumb_width) + 2);
      for (const [index, element] of thumbs)
        if (index < from || index >= to) {
          element.remove();
          thumbs.delete(index);
        }
      for (let index = from; index < to; ++index) {
        if (!thumbs.has(index)) {
          const element = thumb(index);
          thumbs.set(index, element);
          inside.append(element);
        }
        thumbs.get(index).setAttribute("aria-current", String(rows[index] === row));
      }
    };
    strip.addEventListener("scroll", scanshade.once_per_picture(draw_strip));
    new ResizeObserver(draw_strip).observe(strip);

    return {
      fill(all) {
        rows = all;
        inside.style.width = `${rows.length * thumb_width}px`;
        draw_strip();
      },
      async select(next, index) {
        row = next;
        const left = index * thumb_width;
        if (left < strip.scrollLeft || left + thumb_width > strip.scrollLeft + strip.clientWidth)
          strip.scrollLeft = left - (strip.clientWidth - thumb_width) / 2;
        draw_strip();
        let found = null, trouble = "";
        try {
          found = await scanshade.preview_of(next);
        } catch (failure) {
          trouble = failure.message;
        }
        if (row !== next) return; // another frame was picked while this one loaded
        preview = found;
        draw();
        if (trouble) tell(trouble);
        for (const neighbour of [rows[index + 1], rows[index - 1]])
          if (neighbour) scanshade.preview_of(neighbour).catch(() => {});
      },
      key(event) {
        const number = "123456789".indexOf(event.code.startsWith("Digit") ? event.code[5] : "x");
        if (number >= 0 && row) {
          const choice = kinds.filter((kind) => kind.there(row, preview))[number];
          if (choice) {
            sides[event.shiftKey ? "left" : "right"] = choice.key;
            draw();
          }
          return true;
        }
        if (event.key === "+" || event.key === "=") enlarge(1.25);
        else if (event.key === "-") enlarge(0.8);
        else if (event.key === "0") fit();
        else return false;
        return true;
      },
    };
  };
}
