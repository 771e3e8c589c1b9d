// The controls of a point view's colours: the choice, the bar with its range or the legend of classes, and how much AO darkens.
"use strict";
{
  const { by_id, make, link } = scanshade;

  /** `chunks()`: those loaded; `clouds()`: the facts of their clouds; `changed()`: draw again. */
  scanshade.colour_control = ({ chunks, clouds, changed }) => {
    const select = by_id("point-colour"), strength = by_id("point-strength"), ends = [by_id("range-low"), by_id("range-high")], legend = by_id("class-legend");
    let painter = null, offered = [], chosen = null, range = null, wanted = link.text("colour"), turn = 0;

    const show_range = () => {
      by_id("range").hidden = !chosen.numbers || Boolean(chosen.classes);
      if (by_id("range").hidden) return;
      const step = Math.pow(10, Math.floor(Math.log10(range[1] - range[0])) - 2);
      ends.forEach((end, i) => {
        end.step = step;
        end.value = scanshade.in_steps(range[i], step);
      });
      const context = by_id("range-ramp").getContext("2d");
      chosen.ramp.forEach((colour, i) => {
        context.fillStyle = `rgb(${colour.join(",")})`;
        context.fillRect(i, 0, 1, 1);
      });
    };
    const show_classes = () => {
      legend.hidden = !chosen.classes;
      if (legend.hidden) return;
      const counts = scanshade.class_counts(clouds(), chosen.classes);
      const all = [...counts.values()].reduce((sum, count) => sum + count, 0);
      legend.replaceChildren(...[...counts].map(([value, count]) => {
        const swatch = make("span", { class: "swatch" }), share = ` ${(100 * count / all).toFixed(1)} %`;
        swatch.style.background = `rgb(${scanshade.class_colour(chosen.classes, value).join(",")})`;
        return make("li", {}, swatch, `${value} ${scanshade.class_words(chosen.classes, value)}`.trim(), make("span", { class: "quiet" }, share));
      }));
    };

    /** Gives a chunk the numbers of the choice. */
    const colour = async (chunk) => {
      const { numbers } = chosen, number = turn;
      chunk.numbers = null;
      if (!numbers) return;
      const found = await numbers(chunk);
      if (number !== turn || !chunk.shape) return; // another choice or source since
      painter.upload_codes(chunk.shape, found.codes);
      chunk.numbers = found;
      if (!chunk.inner) range ??= chosen.range || scanshade.usual_range(found); // an inner node is no sample of the whole
    };
    const choose = async (key, keep) => {
      chosen = offered.find((each) => each.key === key) || offered[0];
      select.value = chosen.key;
      const number = ++turn;
      if (!keep || chosen.classes) range = null;
      if (!keep) strength.value = chosen.ramp && !chosen.classes ? 0 : 1; // values are read off a bar as they are
      strength.parentElement.hidden = Boolean(chosen.unshaded) || !offered.some((each) => each.key === "ao");
      if (chosen.ramp) painter.set_ramp(chosen.ramp);
      for (const chunk of chunks()) await colour(chunk);
      if (number !== turn) return;
      show_range();
      show_classes();
      changed();
    };

    select.addEventListener("change", () => {
      wanted = select.value;
      choose(wanted, false);
    });
    for (const end of ends)
      end.addEventListener("input", () => {
        const values = ends.map((each) => Number(each.value));
        if (!(values[0] < values[1])) return;
        range = values;
        changed();
      });
    strength.addEventListener("input", changed);

    let asked = { range: link.numbers("range", 2), strength: link.numbers("ao", 1) }; // of the link, once
    return {
      use(made) { painter = made; },
      /** Offers what a source's first chunk has; the choice before stays where it can. */
      async offer(chunk, up) {
        const again = offered.length > 0 && chosen;
        offered = scanshade.colourings(chunk, up);
        select.replaceChildren(...offered.map(({ key, label }) => make("option", { value: key }, label)));
        range = asked?.range || (again ? range : null);
        if (asked?.strength) strength.value = asked.strength[0];
        const keep = Boolean(asked?.strength || (again && offered.some(({ key }) => key === chosen.key)));
        asked = null;
        await choose(wanted || (again ? chosen.key : "colour"), keep);
      },
      /** Colours a chunk that came later. */
      async take(chunk) {
        await colour(chunk);
        show_classes();
      },
      /** For the painter, and each chunk's range in its own codes. */
      look() {
        for (const chunk of chunks()) if (chunk.numbers && range) chunk.range = range.map((value) => (value - chunk.numbers.low) / chunk.numbers.step + 1);
        return { base: chosen?.base ?? 0, strength: strength.parentElement.hidden ? 0 : Number(strength.value) };
      },
      words() {
        const own_range = range && chosen.numbers && !chosen.classes ? [["range", range.map((value) => Number(value.toPrecision(9)))]] : [];
        return [["colour", chosen.key], ["ao", strength.value], ...own_range];
      },
    };
  };
}
