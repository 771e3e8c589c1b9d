// The clipping box of a point view: a slider for each of its six sides, as shares of the box around all points.
"use strict";
{
  const { by_id, make, link } = scanshade;

  scanshade.clip_control = (changed) => {
    const place = by_id("clip"), sliders = [], values = [];
    let box = null;
    const shares = () => sliders.map((slider) => Number(slider.value));
    const corner = (side) => [0, 1, 2].map((axis) => {
      const both = shares().slice(2 * axis, 2 * axis + 2), share = side === 0 ? Math.min(...both) : Math.max(...both);
      return box[0][axis] + share * (box[1][axis] - box[0][axis]);
    });
    const is_open = () => shares().every((share, i) => share === i % 2);
    const tell = () => {
      const corners = box && [corner(0), corner(1)];
      for (let axis = 0; box && axis < 3; ++axis)
        values[axis].textContent = corners.map((each) => scanshade.in_steps(each[axis], (box[1][axis] - box[0][axis]) / 200)).join(" to ");
    };
    const asked = link.numbers("clip", 6);
    for (const axis of "xyz") {
      values.push(make("span", { class: "quiet" }));
      for (const side of ["from", "to"]) {
        const share = asked ? asked[sliders.length] : Number(side === "to");
        sliders.push(make("input", { type: "range", min: "0", max: "1", step: "0.005", value: String(share), "aria-label": `${axis} ${side}` }));
      }
      place.append(make("div", { class: "clip-axis" }, axis, ...sliders.slice(-2), values[values.length - 1]));
    }
    const set_open = () => sliders.forEach((slider, i) => { slider.value = i % 2; });
    const update = () => {
      tell();
      changed();
    };
    for (const slider of sliders) slider.addEventListener("input", update);
    place.append(make("button", { type: "button", onclick: () => { set_open(); update(); } }, "All"));
    if (asked) place.open = true;
    return {
      /** The box around all points has grown to this. */
      fit(next) {
        box = next;
        tell();
      },
      /** Two corners, or null where nothing is clipped. A slider at its end clips nothing, not even stray points. */
      corners() {
        const beyond = [-1e30, 1e30];
        return !box || is_open() ? null : [0, 1].map((side) => corner(side).map((value, axis) => (value === box[side][axis] ? beyond[side] : value)));
      },
      words: () => (is_open() ? [] : [["clip", shares()]]),
    };
  };
}
