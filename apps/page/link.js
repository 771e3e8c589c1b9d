// The view in the page's address behind #: the frame's number, and words of parts, as in #3&points&colour=height. Written once
// nothing has changed for a while, because browsers allow few changes a second.
"use strict";
{
  const parts = new Map();
  let waiting = 0;
  const [asked_row, ...words] = location.hash.slice(1).split("&");
  const asked = new URLSearchParams(words.join("&"));

  const write = () => {
    const text = [...parts.values()].filter((part) => part !== "").join("&");
    history.replaceState(null, "", "#" + text);
  };

  /** Pairs of name and value, or values, as words of a link. */
  scanshade.words = (pairs) => pairs.map(([name, value]) => `${name}=${[value].flat().map(encodeURIComponent).join(",")}`).join("&");

  scanshade.link = {
    row: asked_row,
    has: (word) => asked.has(word),
    text: (word) => asked.get(word),
    /** So many finite numbers, or null. */
    numbers(word, count) {
      const values = (asked.get(word) || "").split(",").map(Number);
      return asked.get(word) && values.length === count && values.every(Number.isFinite) ? values : null;
    },
    /** The eye and axes of the camera in the link, or null. */
    camera() {
      const [eye, forward, down] = ["eye", "forward", "down"].map((word) => this.numbers(word, 3));
      const [distance, half] = ["distance", "half"].map((word) => this.numbers(word, 1));
      return this.has("points") && eye && forward && down && distance && half
        ? { eye, ...scanshade.looking(forward, down), distance: distance[0], half_height: half[0] } : null;
    },
    /** Takes a part's words: "row", then "points". */
    put(part, words) {
      parts.set(part, words);
      clearTimeout(waiting);
      if (part === "row") write();
      else waiting = setTimeout(write, 300);
    },
  };
  // Another link in the same tab.
  addEventListener("hashchange", () => location.reload());
}
