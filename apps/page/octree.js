// Clouds as octrees of chunks, which points.cpp writes: the nodes that a view needs, loaded when it does and dropped when it
// does not.
"use strict";
{
  const most_kept = 4e6, at_once = 4;
  const finest_px = 1.2; // points closer to each other on the screen need no more between them
  const apart = 3; // neighbours on the curve are nearer than the points' spacing; discs have to cover the gaps between uneven ones

  const path_of = (stem, part) => `${stem}.${String(part).padStart(3, "0")}.js`;

  /** The nodes of a cloud, the root first. `load()` reads a node's points, `facts` are the cloud's. */
  scanshade.octree_nodes = async (stem) => {
    const data = await scanshade.load(path_of(stem, 0)), { facts } = data, nodes = [];
    if (!facts) throw new Error(`${path_of(stem, 0)} is of another version: run again`);
    const { tree, cube } = facts;
    for (const [part, [parent, octant, count, spacing]] of tree.entries()) {
      const above = part > 0 ? nodes[parent] : null, edge = above ? above.edge / 2 : cube[3];
      const low = above ? above.low.map((value, axis) => value + (octant >> axis & 1) * edge) : cube.slice(0, 3);
      const node = { facts, above, low, edge, count, spacing, level: above ? above.level + 1 : 0, children: Array(8).fill(null), state: "", chunk: null, used: 0, drawn: 0,
        load: async (read) => scanshade.opened_chunk(read || await scanshade.load(path_of(stem, part)), { low, edge }, facts) };
      if (above) above.children[octant] = node;
      nodes.push(node);
    }
    nodes[0].chunk = await nodes[0].load(data);
    return nodes;
  };

  /** Whether a sphere around the node's box is in the picture. */
  const in_sight = ({ low, edge }, { eye, right, down, forward, half_height }, aspect) => {
    const to = low.map((value, axis) => value + edge / 2 - eye[axis]), radius = edge * Math.sqrt(0.75);
    const along = (axis) => axis[0] * to[0] + axis[1] * to[1] + axis[2] * to[2], z = along(forward);
    const beside = (off, half) => Math.abs(off) - z * half > radius * Math.hypot(1, half);
    return z > -radius && !beside(along(right), half_height * aspect) && !beside(along(down), half_height);
  };
  const distance_to = ({ low, edge }, eye) => Math.hypot(...low.map((value, axis) => Math.max(value - eye[axis], eye[axis] - value - edge, 0)));
  const in_clip = ({ low, edge }, clip) => !clip || low.every((value, axis) => value <= clip[1][axis] && value + edge >= clip[0][axis]);

  /** The parts of a chunk whose points lie in one and the same finest drawn box, and that box's spacing. */
  const ranges_of = (node, turn) => {
    const { positions, origin } = node.chunk, ranges = [];
    const put = (first, end, spacing) => {
      const last = ranges[ranges.length - 1];
      if (last?.spacing === spacing) last.count += end - first;
      else ranges.push({ first, count: end - first, spacing });
    };
    const split = (first, end, box) => {
      if (!box.children.some((child) => child?.drawn === turn)) return put(first, end, apart * box.spacing || 0.01);
      const middle = box.low.map((value, axis) => value - origin[axis] + box.edge / 2);
      const octant = (i) => (positions[3 * i] >= middle[0]) | (positions[3 * i + 1] >= middle[1]) << 1 | (positions[3 * i + 2] >= middle[2]) << 2;
      for (let at = first, k = 0; k < 8 && at < end; ++k) { // points are along the curve, hence octant by octant
        let low = at, high = end;
        while (low < high) {
          const half = (low + high) >> 1;
          if (octant(half) > k) high = half;
          else low = half + 1;
        }
        if (low > at) box.children[k]?.drawn === turn ? split(at, low, box.children[k]) : put(at, low, apart * box.spacing || 0.01);
        at = low;
      }
    };
    split(0, node.count, node);
    return ranges;
  };

  /** `take(chunk)`: uploads and colours a node's points; `drop(chunk)`: releases them; `changed()`: draw again; `failed(error)`. */
  scanshade.octrees = ({ take, drop, changed, failed }) => {
    let roots = [], all = [], clouds = [], wanted = [], loading = 0, turn = 0, number = 0;

    const load = async (node) => {
      const mine = number;
      node.state = "loading";
      ++loading;
      try {
        const chunk = await node.load();
        if (mine !== number) return;
        chunk.inner = true;
        await take(chunk);
        if (mine !== number) return;
        node.chunk = chunk;
        node.state = "ready";
      } catch (failure) {
        if (mine !== number) return;
        node.state = "failed";
        failed(failure);
      }
      --loading;
      go_on();
      changed();
    };
    const go_on = () => {
      while (loading < at_once && wanted.length > 0) {
        const node = wanted.shift();
        if (node.state === "") load(node);
      }
    };
    /** Drops what was not drawn for the longest time, where too much is kept; roots stay. */
    const tidy = () => {
      let kept = all.reduce((sum, node) => sum + (node.chunk ? node.count : 0), 0);
      if (kept <= most_kept) return;
      for (const node of all.filter((each) => each.above && each.chunk && each.used !== turn).sort((a, b) => a.used - b.used || b.level - a.level)) {
        if (kept <= most_kept) return;
        kept -= node.count;
        drop(node.chunk);
        node.chunk = null;
        node.state = "";
      }
    };

    return {
      clear() {
        [roots, clouds, wanted, all, loading] = [[], [], [], [], 0];
        ++number;
      },
      clouds: () => clouds,
      is_open: () => roots.length > 0,
      /** Whether all nodes that the last choice needs are there. */
      is_settled: () => loading === 0 && wanted.length === 0,
      /** Opens clouds one after the other; `use(chunk, facts)` gets the root's points and returns false to stop. */
      async open(stems, use) {
        const mine = number;
        for (const stem of stems) {
          const nodes = await scanshade.octree_nodes(stem), root = nodes[0], { chunk, facts } = root;
          if (mine !== number) return;
          root.state = "ready";
          roots.push(root);
          clouds.push(facts);
          all.push(...nodes);
          if (!use(chunk, facts)) return;
        }
      },
      /**
       * The chunks to draw of at most about `most` points, those that look coarsest first; their parts are in their `ranges`.
       * Starts loading what is missing where `loads`.
       */
      choose(camera, [width, height], clip, most, loads) {
        ++turn;
        const focal = height / (2 * camera.half_height), waiting = [], missing = [], chosen = [];
        const offer = (node) => {
          if (!in_clip(node, clip) || !in_sight(node, camera, width / height)) return;
          // How coarse the box looks without the node; roots come first.
          const pixels = (node.above ? node.above.spacing : 1e6 * node.edge) * focal / distance_to(node, camera.eye);
          if (!node.above || !(pixels < finest_px)) waiting.push([pixels, node]);
        };
        roots.forEach(offer);
        for (let points = 0; waiting.length > 0;) {
          let best = 0;
          for (let i = 1; i < waiting.length; ++i) if (waiting[i][0] > waiting[best][0]) best = i;
          const [[, node]] = waiting.splice(best, 1);
          points += node.count;
          if (points > most && chosen.length > 0) break;
          node.used = turn;
          if (!node.chunk) {
            missing.push(node);
            continue;
          }
          node.drawn = turn;
          chosen.push(node);
          for (const child of node.children) if (child) offer(child);
        }
        for (const node of chosen) node.chunk.ranges = ranges_of(node, turn);
        if (loads) {
          wanted = missing.filter((node) => node.state === "");
          tidy();
          go_on();
        }
        return chosen.map((node) => node.chunk);
      },
    };
  };
}
