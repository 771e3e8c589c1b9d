// What points a page can show for a row: clouds and the merged recording as octrees, depth frames.
"use strict";
{
  /** So many of all, evenly. */
  const spread = (all, most) => (all.length <= most ? all : Array.from({ length: most }, (_, i) => all[Math.round(i * (all.length - 1) / (most - 1))]));
  scanshade.spread = spread;

  /** points/NAME, where a row has a cloud. */
  const stem_of = (row) => row?.file("points", ".000.js")?.slice(0, -7);
  scanshade.has_cloud = (row) => Boolean(stem_of(row));

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

  /** Sources of a row: {key, label, world, and stems: of octrees' files, or load}. `key` stays the same where changing the frame needs no new points. */
  scanshade.point_sources = ({ rows, head }) => {
    const posed = rows.filter((row) => row.pose), tiles = rows.filter((row) => stem_of(row) && !row.pose);
    return (row) => {
      const sources = [];
      if (stem_of(row)) sources.push({ key: `cloud ${row.index}`, label: "cloud", stems: [stem_of(row)] });
      if (head.recording_points) sources.push({ key: "recording", label: "recording, merged", world: true, stems: [head.recording_points] });
      if (row?.file("previews", ".js")) sources.push({ key: `frame ${row.index}`, label: "this frame", world: Boolean(row.pose), load: (take) => load_frames([row], 1, take) });
      if (tiles.length > 1) sources.push({ key: "clouds", label: "all clouds", stems: spread(tiles, 64).map(stem_of) });
      if (posed.length > 1 && posed[0].file("previews", ".js")) sources.push({ key: "together", label: "frames together", world: true, load: (take) => load_frames(spread(posed, 24), 2, take) });
      return sources;
    };
  };
}
