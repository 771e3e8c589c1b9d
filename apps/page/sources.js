// What points a page can show for a row, and how they are loaded: clouds in chunks, the merged recording, depth frames.
"use strict";
{
  /** So many of all, evenly. */
  const spread = (all, most) => (all.length <= most ? all : Array.from({ length: most }, (_, i) => all[Math.round(i * (all.length - 1) / (most - 1))]));
  scanshade.spread = spread;

  /** points/NAME, where a row has a cloud. */
  const stem_of = (row) => row?.file("points", ".000.js")?.slice(0, -7);
  scanshade.has_cloud = (row) => Boolean(stem_of(row));

  /** Chunk after chunk: STEM.000.js and on. `take` returns false once the chunks are wanted no more. */
  const load_chunks = async (stem, take, most = Infinity) => {
    for (let part = 0, parts = 1; part < Math.min(parts, most); ++part) {
      const data = await scanshade.load(`${stem}.${String(part).padStart(3, "0")}.js`);
      parts = data.parts;
      const chunk = await scanshade.opened_chunk(data);
      // Neighbours on the curve are nearer than the points' spacing; discs have to cover the gaps between uneven ones.
      chunk.spacing = 3 * data.spacing || 0.01;
      if (!take(chunk, { total: data.total, of: data.of, up: data.up, left_out: data.left_out })) return false;
    }
    return true;
  };

  /** An even sample of each cloud, a million points in all. */
  const load_clouds = async (rows, take) => {
    const sums = { total: 0, of: 0, left_out: 0 }, each_most = Math.max(1, Math.floor(10 / rows.length));
    for (const each of spread(rows, 64)) {
      const before = { ...sums };
      const wanted = await load_chunks(stem_of(each), (chunk, facts) => {
        for (const sum of Object.keys(sums)) sums[sum] = before[sum] + facts[sum];
        return take(chunk, { ...facts, ...sums });
      }, each_most);
      if (!wanted) return;
    }
  };

  const load_frames = async (rows, stride, take) => {
    for (const each of rows) {
      const preview = await scanshade.preview_of(each);
      if (!preview?.z_m || !preview.camera) continue;
      const chunk = await scanshade.chunk_of_preview(preview, each.pose, stride);
      // A pixel covers more the farther away it is; slanted surfaces lie wider apart.
      chunk.slope = 1.3 * stride * preview.step / preview.camera[0];
      if (!take(chunk, {})) return;
    }
  };

  /** Sources of a row: {key, label, world, load}. `key` stays the same where changing the frame needs no new points. */
  scanshade.point_sources = ({ rows, head }) => {
    const posed = rows.filter((row) => row.pose), tiles = rows.filter((row) => stem_of(row) && !row.pose);
    return (row) => {
      const sources = [];
      if (stem_of(row)) sources.push({ key: `cloud ${row.index}`, label: "cloud", load: (take) => load_chunks(stem_of(row), take) });
      if (head.recording_points) sources.push({ key: "recording", label: "recording, merged", world: true, load: (take) => load_chunks(head.recording_points, take) });
      if (row?.file("previews", ".js")) sources.push({ key: `frame ${row.index}`, label: "this frame", world: Boolean(row.pose), load: (take) => load_frames([row], 1, take) });
      if (tiles.length > 1) sources.push({ key: "clouds", label: "all clouds", load: (take) => load_clouds(tiles, take) });
      if (posed.length > 1 && posed[0].file("previews", ".js")) sources.push({ key: "together", label: "frames together", world: true, load: (take) => load_frames(spread(posed, 24), 2, take) });
      return sources;
    };
  };
}
