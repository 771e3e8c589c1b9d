// Looks at pages in Chromium, as people do: node browser.js SPEC.json RESULT.json. The result has a line for each check:
// "" where it holds, else what was found.
"use strict";
const fs = require("fs");
const http = require("http");
const path = require("path");

const spec = JSON.parse(fs.readFileSync(process.argv[2], "utf8"));
const module_of = (name) => require(path.join(spec.modules, name));
const { chromium } = module_of("playwright-core");
const results = {};

class Wrong extends Error {}
const expect = (held, words) => { if (!held) throw new Wrong(words); };

/** Serves folders by path; nothing else listens. */
const serve = () => new Promise((resolve) => {
  const types = { ".html": "text/html", ".js": "text/javascript", ".png": "image/png", ".svg": "image/svg+xml" };
  const server = http.createServer((request, response) => {
    if (request.url === "/favicon.ico") return void response.writeHead(204).end(); // browsers ask for it where a file is an SVG
    const file = decodeURIComponent(request.url.split(/[?#]/)[0]);
    fs.readFile(file, (failure, bytes) => {
      response.writeHead(failure ? 404 : 200, { "content-type": types[path.extname(file)] || "application/octet-stream" });
      response.end(failure ? "" : bytes);
    });
  });
  server.listen(0, "127.0.0.1", () => resolve(server));
});

const coded = (file) => file.split("/").map(encodeURIComponent).join("/");

(async () => {
  const browser = await chromium.launch({ executablePath: spec.chromium, args: ["--no-sandbox", "--headless=new", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"] });
  const server = await serve();
  const schemes = { file: (file) => "file://" + coded(file), http: (file) => `http://127.0.0.1:${server.address().port}${coded(file)}` };

  /** A fresh page at a file; what it complains of and asks for is kept. */
  const open = async (file, { scheme = "file", width = 1440, height = 900, dark = false, before, hash = "", wait = true } = {}) => {
    const context = await browser.newContext({ viewport: { width, height }, colorScheme: dark ? "dark" : "light", reducedMotion: "reduce" });
    const page = await context.newPage();
    page.complaints = [];
    page.asked = [];
    page.on("console", (message) => { if (["error", "warning"].includes(message.type()) && !/GPU stall|GL Driver Message/.test(message.text())) page.complaints.push(message.text()); });
    page.on("pageerror", (failure) => page.complaints.push(failure.message));
    page.on("request", (request) => page.asked.push(request.url()));
    if (before) await page.addInitScript(before);
    await page.goto(schemes[scheme](file) + hash);
    if (wait) await page.waitForSelector("html[data-ready]", { timeout: 20000 });
    return page;
  };
  /** Time passes, and pictures: what an action asks for is drawn by the second one after it, however slow they are. */
  const pause = async (page, ms) => {
    await page.waitForTimeout(ms);
    await page.evaluate(async () => { for (let i = 0; i < 4; ++i) await new Promise(requestAnimationFrame); });
  };
  const loaded = (page) => page.waitForFunction(() => [...document.querySelectorAll(".layer img")].every((image) => image.complete) && document.querySelector("#layer-right .inside"), null, { timeout: 10000 });
  const settle = async (page) => { await loaded(page); await pause(page, 120); };

  const decoder = await (await browser.newContext()).newPage();
  /** Red, green, blue of the element's picture at shares of its width and height. */
  const pixel = async (page, selector, x, y) => {
    const shot = (await page.locator(selector).screenshot()).toString("base64");
    return decoder.evaluate(async ([base64, a, b]) => {
      const image = new Image();
      image.src = "data:image/png;base64," + base64;
      await image.decode();
      const canvas = new OffscreenCanvas(image.width, image.height), context = canvas.getContext("2d");
      context.drawImage(image, 0, 0);
      return [...context.getImageData(Math.floor(a * image.width), Math.floor(b * image.height), 1, 1).data.slice(0, 3)];
    }, [shot, x, y]);
  };
  /** Of two pictures: the mean difference of channels (0 .. 255), and the share of pixels of the first that are not background. */
  const difference = (a, b) => decoder.evaluate(async (both) => {
    const images = await Promise.all(both.map(async (base64) => {
      const image = new Image();
      image.src = "data:image/png;base64," + base64;
      await image.decode();
      return image;
    }));
    const { width, height } = images[0]; // that of the other one may be a pixel more
    const [one, other] = images.map((image) => {
      const context = new OffscreenCanvas(width, height).getContext("2d");
      context.drawImage(image, 0, 0, width, height);
      return context.getImageData(0, 0, width, height).data;
    });
    let sum = 0, covered = 0;
    for (let i = 0; i < one.length; i += 4) {
      for (let channel = 0; channel < 3; ++channel) sum += Math.abs(one[i + channel] - other[i + channel]);
      covered += Math.max(Math.abs(one[i] - 20), Math.abs(one[i + 1] - 23), Math.abs(one[i + 2] - 27)) > 20;
    }
    return { mean: sum / (one.length / 4 * 3), covered: covered / (one.length / 4) };
  }, [a, b].map((picture) => picture.toString("base64")));
  const apart = (a, b) => Math.max(...a.map((value, i) => Math.abs(value - b[i])));
  const slide = (page, id, value) => page.locator(id).evaluate((element, to) => { element.value = to; element.dispatchEvent(new Event("input", { bubbles: true })); }, value);
  const names = (page) => page.$$eval("#rows tbody tr[data-row]", (lines) => lines.map((line) => line.children[1].textContent));
  const column = (page, index) => page.$$eval("#rows tbody tr[data-row]", (lines, at) => lines.map((line) => Number(line.children[at].textContent)), index);
  const frame = (page) => page.textContent("#frame-name");

  /** Where a pixel of the image is on the stage, as shares: the stage may be wider than the image. */
  const on_stage = async (page, selector, [x, y]) => {
    const box = await page.locator(selector).boundingBox(), shape = spec.size[0] / spec.size[1], width = Math.min(box.width, box.height * shape);
    return [0.5 + ((x + 0.5) / spec.size[0] - 0.5) * width / box.width, 0.5 + ((y + 0.5) / spec.size[1] - 0.5) * width / shape / box.height];
  };

  const only = new RegExp(process.env.ONLY || "");
  const check = async (name, steps) => {
    if (!only.test(name)) return;
    const pages = [];
    try {
      await steps(async (...words) => { const page = await open(...words); pages.push(page); return page; });
      results[name] = "";
    } catch (failure) {
      results[name] = failure instanceof Wrong ? failure.message : String(failure.stack || failure);
    }
    for (const page of pages) await page.context().close().catch(() => {});
  };

  const { run, cloud, hostile, comparison, list, large, bench, camera, old } = spec.pages;
  const is_document = (file) => file === bench || file === camera || file.endsWith(".svg"); // without scripts
  const plots = fs.readdirSync(path.dirname(bench)).filter((name) => name.endsWith(".svg")).map((name) => path.join(path.dirname(bench), name));
  const every = [...Object.values(spec.pages), ...Object.values(spec.tiles), ...plots].filter((file) => file !== large); // that one has no images

  for (const scheme of ["file", "http"])
    await check(`quiet over ${scheme}`, async (open_page) => {
      for (const file of every) {
        const page = await open_page(file, { scheme, wait: !is_document(file) });
        await pause(page, 300);
        if (file === run || file === cloud) {
          await page.click("#show-points");
          await page.waitForFunction(() => document.querySelector("#point-canvas").dataset.loaded, null, { timeout: 20000 });
        }
        expect(page.complaints.length === 0, `${file}: ${page.complaints.join(" | ")}`);
        const folder = schemes[scheme](path.dirname(file)) + "/";
        const outside = page.asked.filter((url) => !url.startsWith(folder) && !url.startsWith("data:"));
        expect(outside.length === 0, `${file} asked for ${outside.join(", ")}`);
      }
    });

  await check("worst first", async (open_page) => {
    const page = await open_page(hostile);
    const statuses = await page.$$eval("#rows tbody tr[data-row]", (lines) => lines.map((line) => line.children[2].textContent));
    expect(statuses[0].includes("failed"), `first: ${statuses[0]}`);
    expect(!statuses[statuses.length - 1].includes("failed"), "last: failed");
    expect((await frame(page)) === (await names(page))[0], "the worst frame is not the one shown");
  });

  await check("sorting", async (open_page) => {
    const page = await open_page(run);
    const index = (await page.$$eval("#rows th", (heads) => heads.map((head) => head.textContent))).indexOf("AO");
    await page.click(`#rows th:nth-child(${index + 1}) button`);
    const rising = await column(page, index);
    expect(rising.length > 3 && rising.every((value, i) => i === 0 || value >= rising[i - 1]), `not rising: ${rising}`);
    expect((await page.getAttribute(`#rows th:nth-child(${index + 1})`, "aria-sort")) === "ascending", "aria-sort");
    await page.click(`#rows th:nth-child(${index + 1}) button`);
    const falling = await column(page, index);
    expect(falling.every((value, i) => i === 0 || value <= falling[i - 1]), `not falling: ${falling}`);
    expect(rising[0] !== falling[0], "both ways are the same");
  });

  await check("filter", async (open_page) => {
    const page = await open_page(run);
    const all = await names(page);
    await page.fill("#filter", all[2].slice(-8));
    const left = await names(page);
    expect(left.length === 1 && left[0] === all[2], `left: ${left}`);
    expect((await page.textContent("#shown")) === `1 of ${all.length}`, await page.textContent("#shown"));
    await page.fill("#filter", "no such frame anywhere");
    expect((await names(page)).length === 0, "rows are left");
  });

  await check("chips and reasons", async (open_page) => {
    const page = await open_page(hostile);
    await page.click(".chip.failed");
    const statuses = await page.$$eval("#rows tbody tr[data-row]", (lines) => lines.map((line) => line.children[2].textContent));
    expect(statuses.length > 0 && statuses.every((status) => status.includes("failed")), statuses.join());
    expect((await page.textContent("#reason-list")).includes("failed"), "no reason of the failure");
  });

  await check("keys", async (open_page) => {
    const page = await open_page(run, { hash: "#0" });
    await settle(page);
    const first = await frame(page);
    await page.keyboard.press("ArrowRight");
    const second = await frame(page);
    expect(second !== first, "right arrow: the same frame");
    expect(page.url().endsWith("#1"), page.url());
    await page.keyboard.press("ArrowLeft");
    expect((await frame(page)) === first, "left arrow does not lead back");
    await settle(page);
    await page.keyboard.press("2");
    expect((await page.getAttribute("#layer-right", "data-kind")) === "depth", await page.getAttribute("#layer-right", "data-kind"));
    await page.keyboard.press("Shift+3");
    expect((await page.getAttribute("#layer-left", "data-kind")) === "ao", await page.getAttribute("#layer-left", "data-kind"));
    expect(!(await page.locator("#legend").isHidden()), "no legend beside depth");
    await page.keyboard.press("+");
    const zoomed = await page.locator("#layer-left .inside").evaluate((inside) => inside.style.transform);
    expect(/scale\(1\.25\)/.test(zoomed) && zoomed === await page.locator("#layer-right .inside").evaluate((inside) => inside.style.transform), `zoom: ${zoomed}`);
    await page.keyboard.press("0");
    expect(/scale\(1\)/.test(await page.locator("#layer-left .inside").evaluate((inside) => inside.style.transform)), "0 does not fit");
    await page.focus("#rows");
    await page.keyboard.press("End");
    expect((await frame(page)) === (await names(page)).pop(), "End of the table");
    await page.keyboard.press("/");
    expect(await page.evaluate(() => document.activeElement.id === "filter"), "/ does not reach the filter");
    await page.keyboard.type("p");
    expect(await page.locator("#point-view").isHidden(), "a letter in the filter switched the view");
  });

  await check("divider", async (open_page) => {
    const page = await open_page(run, { hash: "#0" });
    await page.selectOption("#left", "depth");
    await page.selectOption("#right", "ao");
    await settle(page);
    const box = await page.locator("#stage").boundingBox();
    const at = (x) => [box.x + x * box.width, box.y + 0.6 * box.height];
    await page.mouse.move(...at(0.5));
    await page.mouse.down();
    await page.mouse.move(...at(0.9), { steps: 4 });
    await page.mouse.up();
    const depth = await pixel(page, "#stage", 0.7, 0.6);
    await page.mouse.move(...at(0.9));
    await page.mouse.down();
    await page.mouse.move(...at(0.2), { steps: 4 });
    await page.mouse.up();
    const grey = await pixel(page, "#stage", 0.7, 0.6);
    expect(apart(depth, grey) > 25, `the same on both sides: ${depth} and ${grey}`);
    expect(Math.max(...grey) - Math.min(...grey) < 8, `AO is not grey: ${grey}`);
    await page.focus("#divider");
    const before = Number(await page.getAttribute("#divider", "aria-valuenow"));
    await page.keyboard.press("ArrowRight");
    expect(Number(await page.getAttribute("#divider", "aria-valuenow")) > before, "the arrow key does not move it");
  });

  await check("strength", async (open_page) => {
    const page = await open_page(run, { hash: "#0" });
    await page.selectOption("#left", "shaded");
    await page.selectOption("#right", "shaded");
    await settle(page);
    const [x, y] = await on_stage(page, "#stage", spec.dark); // where little of the surroundings is open
    const strong = await pixel(page, "#stage", x, y);
    await slide(page, "#strength", 0);
    const none = await pixel(page, "#stage", x, y);
    await slide(page, "#strength", 0.5);
    const half = await pixel(page, "#stage", x, y);
    const sum = (colour) => colour[0] + colour[1] + colour[2];
    expect(sum(none) > sum(half) + 6 && sum(half) > sum(strong) + 6, `0: ${none}, 0.5: ${half}, 1: ${strong}`);
  });

  await check("values", async (open_page) => {
    const page = await open_page(run, { hash: "#0" });
    await settle(page);
    for (const { x, y, z, ao } of spec.values) {
      const found = await page.evaluate(async ([px, py]) => {
        const preview = await scanshade.preview_of({ file: (folder, end) => `previews/${document.querySelector("#frame-name").textContent}${end}` });
        const u = Math.round((px - preview.first) / preview.step), v = Math.round((py - preview.first) / preview.step), i = v * preview.size[0] + u;
        return { z: preview.z_m[i], ao: scanshade.share_of(preview.ao[i], 128) };
      }, [x, y]);
      expect(Math.abs(found.z - z) <= 0.001 * z, `depth at ${x}, ${y}: ${found.z} for ${z}`);
      expect(Math.abs(found.ao - ao) <= 0.005, `AO at ${x}, ${y}: ${found.ao} for ${ao}`);
      const box = await page.locator("#stage").boundingBox(), shape = spec.size[0] / spec.size[1];
      const shown = Math.min(box.width, box.height * shape);
      await page.mouse.move(box.x + box.width / 2 + ((x + 0.5) / spec.size[0] - 0.5) * shown, box.y + box.height / 2 + ((y + 0.5) / spec.size[1] - 0.5) * shown / shape);
      const said = await page.textContent("#readout"), depth = Number(/depth ([0-9.]+) m/.exec(said)?.[1]);
      expect(Math.abs(depth - z) < 0.02 * z, `${said} for ${z} m at ${x}, ${y}`);
    }
  });

  const points_of = async (page) => {
    await page.click("#show-points");
    await page.waitForFunction(() => document.querySelector("#point-canvas").dataset.loaded, null, { timeout: 20000 });
    await pause(page, 300);
  };
  const background = [20, 23, 27];

  await check("points of a frame", async (open_page) => {
    const page = await open_page(run, { hash: "#0" });
    await points_of(page);
    await page.selectOption("#point-source", "frame 0");
    await pause(page, 500);
    expect(apart(await pixel(page, "#point-stage", 0.5, 0.5), background) > 20, "the centre is background");
    const [x, y] = await on_stage(page, "#point-stage", spec.dark);
    const strong = await pixel(page, "#point-stage", x, y);
    await slide(page, "#point-strength", 0);
    await pause(page, 300);
    const none = await pixel(page, "#point-stage", x, y);
    expect(none[0] + none[1] + none[2] > strong[0] + strong[1] + strong[2] + 12, `AO strength 0: ${none}, 1: ${strong}`);
    const seen = [];
    for (const mode of ["colour", "ao", "confidence", "normal"]) {
      await page.selectOption("#point-colour", mode);
      await pause(page, 200);
      const centre = await pixel(page, "#point-stage", 0.5, 0.5); // two values may be alike at one of the points
      seen.push([...(await pixel(page, "#point-stage", x, y)), ...centre].join());
    }
    expect(new Set(seen).size === 4, `modes look the same: ${seen.join(" ")}`);
  });

  await check("points are where the depth is", async (open_page) => {
    const page = await open_page(run, { hash: "#0" });
    // The view from the frame's own camera is its image: a pixel's colour is that of the picture.
    await points_of(page);
    await page.selectOption("#point-source", "frame 0");
    await slide(page, "#point-strength", 0);
    await page.locator("#point-edl").uncheck();
    await pause(page, 500);
    const drawn = await pixel(page, "#point-stage", 0.5, 0.5);
    await page.click("#show-frame");
    await page.selectOption("#left", "colour");
    await page.selectOption("#right", "colour");
    await settle(page);
    await page.locator("#divider").evaluate((divider) => { divider.style.visibility = "hidden"; });
    const pictured = await pixel(page, "#stage", 0.5, 0.5);
    expect(apart(drawn, pictured) < 30, `${drawn} in space, ${pictured} in the picture`);
  });

  await check("flight to a frame's camera", async (open_page) => {
    const page = await open_page(run, { hash: "#0" });
    await points_of(page);
    await page.selectOption("#point-source", "recording");
    await pause(page, 1200);
    expect((await page.textContent("#point-readout")).includes("points"), "nothing said of the points");
    for (let i = 0; i < spec.frames - 1; ++i) await page.keyboard.press("ArrowRight");
    await pause(page, 900);
    const eye = await page.evaluate(() => scanshade.shown_camera().eye);
    const pose = spec.last_position;
    expect(Math.hypot(...eye.map((value, i) => value - pose[i])) < 1e-3, `the eye is at ${eye}, the camera at ${pose}`);
    expect(apart(await pixel(page, "#point-stage", 0.5, 0.5), background) > 20, "the centre is background");
    const box = await page.locator("#point-canvas").boundingBox();
    await page.mouse.move(box.x + 200, box.y + 200);
    await page.mouse.down();
    await page.mouse.move(box.x + 320, box.y + 220, { steps: 4 });
    await page.mouse.up();
    const turned = await page.evaluate(() => scanshade.shown_camera().eye);
    expect(Math.hypot(...eye.map((value, i) => value - turned[i])) > 0.05, "dragging does not turn");
    await page.click("#point-home");
    await pause(page, 300);
    const back = await page.evaluate(() => scanshade.shown_camera().eye);
    expect(Math.hypot(...back.map((value, i) => value - pose[i])) < 1e-3, "the button does not lead back");
  });

  await check("points of a cloud", async (open_page) => {
    const page = await open_page(cloud);
    await points_of(page);
    expect((await page.textContent("#point-readout")).startsWith(spec.cloud_said), await page.textContent("#point-readout"));
    expect(apart(await pixel(page, "#point-stage", 0.5, 0.5), background) > 20, "the centre is background");
    // The root spans the whole cloud as an even sample; all nodes together are the cloud, without the stray point.
    const found = await page.evaluate(async (stem) => {
      const nodes = await scanshade.octree_nodes(stem), low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity], parts = Array(4).fill(0), places = new Set();
      let all = 0;
      for (const node of nodes) {
        const chunk = await node.load(), place = (i, axis) => chunk.origin[axis] + chunk.positions[3 * i + axis];
        for (let i = 0; i < chunk.count; ++i) {
          ++all;
          places.add([0, 1, 2].map((axis) => place(i, axis).toFixed(5)).join());
          if (node !== nodes[0]) continue;
          for (let axis = 0; axis < 3; ++axis) [low[axis], high[axis]] = [Math.min(low[axis], place(i, axis)), Math.max(high[axis], place(i, axis))];
          ++parts[(place(i, 0) < 0.01) * 2 + (place(i, 1) < 1)]; // floor or wall, and its halves
        }
      }
      return { nodes: nodes.length, all, places: places.size, low, high, parts, root: nodes[0].count };
    }, spec.cloud_stem);
    expect(found.nodes > 1 && found.root < 100000, `${found.nodes} nodes, ${found.root} points in the root`);
    expect(found.all === 110000 && found.places > 109500, `${found.all} points, ${found.places} places`);
    for (let axis = 0; axis < 3; ++axis)
      expect(Math.abs(found.low[axis] - spec.cloud_box[0][axis]) < 0.05 && Math.abs(found.high[axis] - spec.cloud_box[1][axis]) < 0.05, `the root does not span the cloud: ${JSON.stringify(found)}`);
    for (const part of found.parts) expect(Math.abs(part / found.root - 0.25) < 0.01, `the root is no even sample: ${found.parts}`);
  });

  await check("nodes by need", async (open_page) => {
    const page = await open_page(cloud);
    const in_view = () => page.evaluate(() => scanshade.shown_chunks().reduce((sum, chunk) => sum + chunk.count, 0));
    const rests = async () => {
      await pause(page, 300);
      await page.waitForFunction(() => document.querySelector("#point-canvas").dataset.loaded && !/loading/.test(document.querySelector("#point-readout").textContent), null, { timeout: 20000 });
      await pause(page, 100);
    };
    await points_of(page);
    await rests();
    // What is drawn has each place once, in parts that cover each chunk, and as fine as the screen shows.
    const parts = await page.evaluate(() => scanshade.shown_chunks().map(({ count, ranges }) => [count, ranges.reduce((sum, each) => (each.first === sum ? sum + each.count : NaN), 0)]));
    for (const [count, covered] of parts) expect(count === covered, `${covered} of ${count} points of a chunk are drawn`);
    const asked = () => page.asked.filter((url) => url.includes("/points/")).length;
    await page.focus("#point-canvas");
    for (let i = 0; i < 8; ++i) await page.keyboard.press("+");
    await rests();
    const near = await in_view();
    for (let i = 0; i < 36; ++i) await page.keyboard.press("-");
    await rests();
    const far = await in_view(), loads = asked();
    expect(far < near && far < 110000, `${far} points from afar, ${near} from near`);
    expect((await page.textContent("#point-readout")).endsWith(`${far.toLocaleString("en")} in this view`), await page.textContent("#point-readout"));
    for (let i = 0; i < 28; ++i) await page.keyboard.press("+");
    await rests();
    expect((await in_view()) > far, "coming back loads nothing");
    expect(asked() === loads, "what is kept is loaded again");
    expect(new Set(page.asked).size === page.asked.length, "a file was loaded twice");
    expect(page.complaints.length === 0, page.complaints.join());
  });

  await check("map coordinates", async (open_page) => {
    const pictures = {};
    for (const name of ["origin", "utm", "geocentric"]) {
      const page = await open_page(spec.tiles[name]);
      await points_of(page);
      await pause(page, 400);
      pictures[name] = await page.locator("#point-canvas").screenshot();
    }
    for (const name of ["utm", "geocentric"]) {
      const { mean, covered } = await difference(pictures[name], pictures.origin);
      expect(covered > 0.2, `${name}: ${covered} of the picture is covered`);
      expect(mean < 1, `${name} differs from the origin by ${mean}`);
    }
  });

  await check("tiles", async (open_page) => {
    const page = await open_page(spec.tiles.both);
    await points_of(page);
    await page.selectOption("#point-source", "clouds");
    await page.waitForFunction(() => document.querySelector("#point-canvas").dataset.loaded === "clouds", null, { timeout: 20000 });
    expect((await page.textContent("#point-readout")).startsWith("24,000 points"), await page.textContent("#point-readout"));
    const [low, high] = await page.evaluate(() => scanshade.shown_box());
    for (const [axis, length] of [[0, 40], [1, 20]]) {
      expect(Math.abs(low[axis] - spec.utm[axis]) < 0.5, `the box begins at ${low}`);
      expect(Math.abs(high[axis] - low[axis] - length) < 1, `the box is from ${low} to ${high}`);
    }
  });

  /** Where a place (in the file's coordinates) is on the canvas, as shares, in the view shown. */
  const in_view = (page, place) => page.evaluate((p) => {
    const camera = scanshade.shown_camera(), canvas = document.querySelector("#point-canvas");
    const along = (axis) => axis.reduce((sum, value, i) => sum + value * (p[i] - camera.eye[i]), 0), z = along(camera.forward);
    return [0.5 + along(camera.right) / z / (2 * camera.half_height) * canvas.clientHeight / canvas.clientWidth, 0.5 + along(camera.down) / z / (2 * camera.half_height)];
  }, place);
  const drawn = async (page) => { await pause(page, 400); return page.locator("#point-canvas").screenshot(); };
  const click_at = async (page, place) => {
    const [x, y] = await in_view(page, place), box = await page.locator("#point-canvas").boundingBox();
    await page.mouse.click(box.x + x * box.width, box.y + y * box.height);
    await pause(page, 300);
    return Object.fromEntries(await page.$$eval("#picked-values tr", (lines) => lines.map((line) => [...line.children].map((cell) => cell.textContent))));
  };
  const roof = [10, 10, 4], ground = [3, 4, 0];

  await check("a cloud's page", async (open_page) => {
    const page = await open_page(spec.tiles.origin);
    await points_of(page);
    expect(await page.locator("#frame-view").isHidden(), "it does not open at the points");
    expect((await page.textContent(".chip.all")) === "12,000 points", await page.textContent(".chip.all"));
    for (const id of ["list", "strip", "previous", "range"]) expect(await page.locator(`#${id}`).isHidden(), `${id} of a cloud alone`);
    expect(await page.locator("#beside img").evaluate((image) => image.complete && image.naturalWidth > 0), "no pictures beside");
    const { covered } = await difference(...Array(2).fill(await drawn(page)));
    expect(covered > 0.3, `${covered} of the picture is covered`);
    // Tight, and all in it: corners of the ground are near the picture's edge, none is outside.
    const corners = await Promise.all([[0, 0, 0], [20, 0, 0], [0, 20, 0], [20, 20, 0]].map((place) => in_view(page, place)));
    expect(corners.flat().every((share) => share > -0.02 && share < 1.02), `outside: ${corners.join(" ")}`);
    const least = Math.min(...corners.flat().map((share) => Math.min(share, 1 - share)));
    expect(least < 0.08, `${least} of the picture is free`);
    await page.click("#show-frame");
    for (const id of ["left", "right", "strength", "divider"]) expect(await page.locator(`#${id}`).isHidden(), `${id} of one picture`);
  });

  await check("colourings", async (open_page) => {
    const page = await open_page(spec.tiles.utm);
    await points_of(page);
    await page.locator("#point-edl").uncheck();
    await page.locator("#point-backs").check(); // nothing says on which side of a roof without walls the air is
    const offered = await page.$$eval("#point-colour option", (options) => options.map((option) => option.value));
    for (const key of ["colour", "ao", "height", "field intensity", "field classification", "field return", "field returns", "field gps_time"]) expect(offered.includes(key), `${key} is not among ${offered}`);
    const pictures = [];
    for (const key of ["colour", "ao", "height", "field intensity", "field classification", "field return", "field gps_time"]) {
      await page.selectOption("#point-colour", key);
      pictures.push(await drawn(page));
      for (const before of pictures.slice(0, -1)) expect((await difference(before, pictures[pictures.length - 1])).mean > 2, `${key} looks like another one`);
    }
    await page.selectOption("#point-colour", "height");
    const range = await page.$$eval("#range input", (ends) => ends.map((end) => Number(end.value)));
    expect(Math.abs(range[0] - spec.utm[2]) < 0.1 && range[1] > spec.utm[2] + 3.9 && range[1] < spec.utm[2] + 5.1, `heights of ${range}`);
    const wide = await drawn(page);
    await page.fill("#range-high", String(range[0] + 50));
    expect((await difference(wide, await drawn(page))).mean > 1, "the range changes nothing");
    await page.selectOption("#point-colour", "field classification");
    await slide(page, "#point-strength", 0);
    const legend = await page.$$eval("#class-legend li", (lines) => lines.map((line) => line.textContent));
    for (const [i, words] of ["2 ground", "5 high vegetation 25.0 %", "6 building"].entries()) expect(legend[i]?.startsWith(words), `${words} for ${legend}`);
    await pause(page, 400);
    const shown = await pixel(page, "#point-canvas", ...(await in_view(page, roof.map((value, axis) => value + spec.utm[axis]))));
    expect(apart(shown, [222, 82, 60]) < 4, `a roof in ${shown}`);
    await slide(page, "#point-strength", 1);
    expect((await difference(await drawn(page), pictures[4])).mean < 1, "classes are shaded by AO at first");
    expect(page.complaints.length === 0, page.complaints.join());
  });

  await check("picked points", async (open_page) => {
    const page = await open_page(spec.tiles.utm);
    await points_of(page);
    await page.locator("#point-backs").check();
    const first = await click_at(page, roof.map((value, axis) => value + spec.utm[axis]));
    expect(first.classification === "6 building" && first.return === "1" && first.returns === "1", JSON.stringify(first));
    expect(Math.abs(Number(first.z) - spec.utm[2] - 4) < 0.001, `z ${first.z}`);
    expect(Math.abs(Number(first.x) - spec.utm[0] - Number(first.intensity) / 1000) < 0.001, `x ${first.x}, millimetres ${first.intensity}`);
    expect(!("distance" in first), "a distance from one point");
    const second = await click_at(page, ground.map((value, axis) => value + spec.utm[axis]));
    expect(second.classification === "2 ground", JSON.stringify(second));
    const apart_m = Math.hypot(...["x", "y", "z"].map((axis) => second[axis] - first[axis]));
    expect(Math.abs(Number(second.distance) - apart_m) < 0.001 && apart_m > 5, `${second.distance} for ${apart_m}`);
    expect((await page.$$eval("#point-marks circle", (marks) => marks.length)) === 2, "no marks");
    await page.keyboard.press("Escape");
    expect(await page.locator("#picked").isHidden(), "Escape clears nothing");
  });

  await check("clipping box", async (open_page) => {
    const page = await open_page(spec.tiles.origin);
    await points_of(page);
    const { covered } = await difference(...Array(2).fill(await drawn(page)));
    await page.click("#clip summary");
    await slide(page, "[aria-label='x to']", 0.5);
    const half = await difference(...Array(2).fill(await drawn(page)));
    expect(half.covered < 0.7 * covered && half.covered > 0.3 * covered, `${half.covered} of ${covered}`);
    const right = await in_view(page, [15, 5, 0]), left = await in_view(page, [4, 10, 0]);
    expect(apart(await pixel(page, "#point-canvas", ...right), background) < 20, "what is clipped is drawn");
    expect(apart(await pixel(page, "#point-canvas", ...left), background) > 20, "what is in the box is gone");
    expect(!Object.keys(await click_at(page, [15, 5, 0])).length, "a clipped point was picked");
  });

  await check("PNG", async (open_page) => {
    const page = await open_page(spec.tiles.origin);
    await points_of(page);
    const shot = await drawn(page);
    const [download] = await Promise.all([page.waitForEvent("download", { timeout: 10000 }), page.click("#point-png")]);
    expect(download.suggestedFilename() === "tile.png", download.suggestedFilename());
    const { mean, covered } = await difference(shot, fs.readFileSync(await download.path()));
    expect(mean < 3 && covered > 0.2, `the picture differs by ${mean}`);
    expect(page.complaints.length === 0, page.complaints.join());
  });

  await check("view in the link", async (open_page) => {
    const page = await open_page(spec.tiles.utm);
    await points_of(page);
    await page.selectOption("#point-colour", "height");
    await page.fill("#range-high", String(spec.utm[2] + 10));
    await slide(page, "[aria-label='y from']", 0.25);
    await page.focus("#point-canvas");
    for (const key of ["ArrowLeft", "ArrowUp", "+"]) await page.keyboard.press(key);
    const shot = await drawn(page);
    await pause(page, 500);
    const again = await open_page(spec.tiles.utm, { hash: new URL(page.url()).hash });
    await points_of(again);
    expect((await again.inputValue("#point-colour")) === "height", await again.inputValue("#point-colour"));
    const { mean } = await difference(shot, await drawn(again));
    expect(mean < 1, `the view differs by ${mean} after ${page.url()}`);
  });

  await check("without WebGL", async (open_page) => {
    const page = await open_page(run, { before: () => {
      const real = HTMLCanvasElement.prototype.getContext;
      HTMLCanvasElement.prototype.getContext = function (kind, ...more) { return kind === "webgl2" ? null : real.call(this, kind, ...more); };
    } });
    await page.click("#show-points");
    expect((await page.textContent("#point-empty")).includes("WebGL 2"), await page.textContent("#point-empty"));
    await page.click("#show-frame");
    await page.keyboard.press("ArrowRight");
    await settle(page);
    expect(page.complaints.length === 0, page.complaints.join());
  });

  await check("hostile names", async (open_page) => {
    const page = await open_page(hostile);
    const shown = new Set();
    for (let i = 0; i < spec.hostile_frames; ++i) {
      await page.locator(`#rows tr[data-row="${i}"]`).click();
      shown.add(await frame(page));
      if ((await page.getAttribute(`#rows tr[data-row="${i}"] td:nth-child(3)`, "class")).includes("failed")) continue;
      await settle(page);
      const sizes = await page.$$eval(".layer img", (images) => images.map((image) => image.naturalWidth));
      expect(sizes.length > 0 && sizes.every((size) => size > 0), `images of ${await frame(page)}: ${sizes}`);
    }
    for (const name of spec.hostile_names) expect(shown.has(name), `${JSON.stringify(name)} is not shown: ${JSON.stringify([...shown])}`);
    expect(await page.evaluate(() => window.hit === undefined), "a name ran as a script");
    expect((await page.textContent("#title")) === spec.hostile_title, await page.textContent("#title"));
    const own = fs.readFileSync(hostile, "utf8").match(/^<script/gm).length;
    expect((await page.evaluate(() => document.querySelectorAll("script").length)) === own, "scripts were added");
    expect(page.complaints.length === 0, page.complaints.join(" | "));
  });

  // Were a name to become markup after all, the page's policy is the second lock.
  for (const scheme of ["file", "http"])
    await check(`policy over ${scheme}`, async (open_page) => {
      for (const file of [run, comparison, list, bench, camera]) {
        const page = await open_page(file, { scheme, wait: !is_document(file) });
        await page.evaluate(async () => {
          const script = document.createElement("script");
          script.textContent = "window.hit = 'a script'";
          document.body.append(script);
          document.body.insertAdjacentHTML("beforeend", `<img src="data:," onerror="window.hit = 'a handler'"><a href="javascript:window.hit='a link'" id="lure">x</a>
            <base href="http://127.0.0.1:9/"><style>body { --hit: yes }</style><iframe src="data:text/html,x"></iframe>`);
          document.getElementById("lure").click();
          const far = document.createElement("script");
          far.src = "data:text/javascript,window.hit='a far script'";
          document.body.append(far);
          await fetch("data:,x").then(() => { window.hit = "a fetch"; }, () => {});
          await new Promise((resolve) => setTimeout(resolve, 200));
          if (getComputedStyle(document.body).getPropertyValue("--hit")) window.hit = "a style";
          if (document.baseURI.startsWith("http://127.0.0.1:9")) window.hit = "a base";
        });
        const hit = await page.evaluate(() => window.hit);
        expect(hit === undefined, `${file}: ${hit} got through`);
        const refused = page.complaints.filter((text) => /Content.Security.Policy/i.test(text)).length;
        expect(refused >= 6, `${file}: only ${refused} refusals: ${page.complaints.join(" | ")}`);
      }
    });

  await check("ten thousand rows", async (open_page) => {
    const page = await open_page(large);
    expect((await page.textContent(".chip.all")) === "10000 frames", await page.textContent(".chip.all"));
    const in_page = () => page.$$eval("#rows tbody tr[data-row]", (lines) => lines.length);
    expect((await in_page()) < 100, `${await in_page()} rows in the document`);
    await page.locator("#rows").evaluate((place) => { place.scrollTop = place.scrollHeight; });
    await pause(page, 150);
    const order = await page.$$eval("#rows tbody tr[data-row]", (lines) => lines.map((line) => Number(line.getAttribute("aria-rowindex"))));
    expect(Math.max(...order) === 10001, `the last row is ${Math.max(...order)}`);
    const visible = await page.locator("#rows").evaluate((place) => {
      const line = [...place.querySelectorAll("tr[data-row]")].pop().getBoundingClientRect(), box = place.getBoundingClientRect();
      return line.bottom <= box.bottom + 1 && line.top >= box.top;
    });
    expect(visible, "the last row is not in sight");
    const ms = await page.evaluate(() => {
      const began = performance.now();
      document.querySelector("#rows th:nth-child(2) button").click();
      document.querySelector("#rows").getBoundingClientRect();
      return performance.now() - began;
    });
    expect(ms < 1500, `sorting took ${ms} ms`);
    expect((await names(page))[0] === "frame 00000", (await names(page))[0]);
    await page.locator(".plot svg").first().click({ position: { x: 300, y: 60 } });
    const picked = Number(/frame (\d+)/.exec(await frame(page))[1]);
    expect(picked > 2000 && picked < 8000, `a click in the middle of the plot picked frame ${picked}`);
  });

  await check("comparison", async (open_page) => {
    const page = await open_page(comparison);
    const index = (await page.$$eval("#rows th", (heads) => heads.map((head) => head.textContent))).indexOf("RMSE");
    const errors = await column(page, index);
    expect(errors.length > 3 && errors.every((value, i) => i === 0 || value <= errors[i - 1]), `not worst first: ${errors}`);
    await page.selectOption("#right", "difference");
    await settle(page);
    expect((await page.$$eval("#layer-right img", (images) => images.length)) === 1, "no difference picture");
    expect(await page.locator("#show-points").isHidden(), "points of maps without depth");
  });

  await check("list", async (open_page) => {
    const page = await open_page(list);
    expect((await names(page)).join() === "lost,corner,office", `not worst first: ${await names(page)}`);
    const pictures = await page.$$eval("#rows td.picture img", (images) => Promise.all(images.map((image) => image.decode().then(() => image.naturalWidth))));
    expect(pictures.length === 2 && pictures.every((width) => width > 0), `pictures of the two that have one: ${pictures}`);
    const reasons = await page.$$eval("#reason-list li", (lines) => lines.map((line) => line.textContent));
    expect(reasons.length === 2 && reasons[0].startsWith("1 × failed") && reasons[0].includes("no camera") && reasons[1].startsWith("1 × doubtful"), reasons.join(" | "));
    await page.click(".chip.failed");
    expect((await names(page)).join() === "lost", `failed: ${await names(page)}`);
    await page.click(".chip.all");
    await page.fill("#filter", "orn");
    expect((await names(page)).join() === "corner", `filtered: ${await names(page)}`);
    const first = await page.getAttribute("#rows tbody tr[data-row] a", "href");
    await page.click("#rows tbody tr[data-row] a");
    await page.waitForSelector("html[data-ready] #viewer");
    expect(page.url().includes("/list/" + first), page.url());
  });

  await check("failed run", async (open_page) => {
    const page = await open_page(spec.pages.failed);
    const lead = await page.textContent("#lead");
    for (const words of ["1 of 1 failed: the depth image has no camera", "give --camera FILE or --camera fx,fy,cx,cy", "--resume --retry"]) expect(lead.includes(words), `${words}: ${lead}`);
    expect((await page.textContent("#details")).includes("lost.png"), "no command line to run again");
  });

  await check("whole sentences", async (open_page) => {
    for (const file of [hostile, spec.pages.failed, list, cloud])
      for (const width of [1440, 390]) {
        const page = await open_page(file, { width });
        const cut = await page.$$eval("#rows td, #frame-name, #lead, #about p, #notes li, #reason-list li", (all) => all.filter((each) => each.offsetParent && each.scrollWidth > each.clientWidth + 1).map((each) => each.textContent));
        expect(cut.length === 0, `${file}, ${width}: ${cut.join(" | ")}`);
      }
  });

  await check("older results", async (open_page) => {
    const page = await open_page(old); // made by `view` of results without previews
    await settle(page);
    const sizes = await page.$$eval(".layer img", (images) => images.map((image) => image.naturalWidth));
    expect(sizes.length > 0 && sizes.every((size) => size > 0), "no images");
    await page.click("#show-points");
    expect((await page.textContent("#point-empty")).includes("no points"), await page.textContent("#point-empty"));
  });

  await check("missing files", async (open_page) => {
    const bare = path.join(path.dirname(spec.scratch), "alone.html");
    fs.copyFileSync(run, bare);
    const page = await open_page(bare, { wait: false });
    await pause(page, 300);
    expect((await page.textContent("#trouble")).includes("index.js is not beside this page"), await page.textContent("#trouble"));
    const folder = path.join(path.dirname(spec.scratch), "partly");
    fs.mkdirSync(folder, { recursive: true });
    for (const file of ["index.html", "index.js"]) fs.copyFileSync(path.join(path.dirname(run), file), path.join(folder, file));
    const partly = await open_page(path.join(folder, "index.html"));
    await pause(partly, 500);
    expect((await partly.textContent("#readout")).includes("is missing"), await partly.textContent("#readout"));
  });

  await check("narrow screens", async (open_page) => {
    for (const file of [run, cloud, comparison, list, bench, camera]) {
      const page = await open_page(file, { width: 360, height: 740, wait: !is_document(file) });
      await pause(page, 200);
      const wide = await page.evaluate(() => document.scrollingElement.scrollWidth - innerWidth);
      expect(wide <= 0, `${file} is ${wide} px too wide`);
    }
  });

  await check("valid markup", async () => {
    const { HtmlValidate } = module_of("html-validate");
    const validator = new HtmlValidate({ extends: ["html-validate:recommended"], rules: { "no-inline-style": "off", "long-title": "off", "require-sri": "off", "no-trailing-whitespace": "off" } });
    const amiss = [];
    for (const file of [run, hostile, list, comparison, bench, camera]) {
      const report = await validator.validateString(fs.readFileSync(file, "utf8"), file);
      amiss.push(...report.results.flatMap((each) => each.messages.map((message) => `${file}:${message.line}: ${message.ruleId}: ${message.message}`)).slice(0, 10));
    }
    expect(amiss.length === 0, amiss.join("\n"));
  });

  await check("accessible", async (open_page) => {
    const amiss = [];
    const axe = fs.readFileSync(path.join(spec.modules, "axe-core", "axe.min.js"), "utf8");
    for (const file of [run, cloud, hostile, comparison, list, bench, camera])
      for (const dark of [false, true]) {
        const page = await open_page(file, { dark, wait: !is_document(file) });
        await pause(page, 300);
        for (const view of file === run ? ["frame", "points"] : [""]) {
          if (view === "points") await page.click("#show-points");
          await page.evaluate(axe);
          const found = await page.evaluate(() => axe.run(document, { resultTypes: ["violations"] }));
          for (const each of found.violations)
            amiss.push(`${file} ${dark ? "dark" : "light"} ${view}: ${each.id}: ${each.nodes.slice(0, 3).map((node) => `${node.html.slice(0, 160)} ${(node.any[0] || node.all[0] || node.none[0])?.message || ""}`).join(" ; ")}`);
        }
        await page.context().close();
      }
    expect(amiss.length === 0, amiss.join("\n"));
  });

  await browser.close();
  server.close();
  fs.writeFileSync(process.argv[3], JSON.stringify(results, null, 1));
})().catch((failure) => {
  console.error(failure);
  process.exit(1);
});
