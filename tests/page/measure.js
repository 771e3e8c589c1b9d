// Times of a page in Chromium: node measure.js MODULES CHROMIUM page|points INDEX.HTML prints cells of a table; pictures
// INDEX.HTML FOLDER takes its pictures.
"use strict";
const fs = require("fs");
const path = require("path");
const [modules, chromium, what, file, folder] = process.argv.slice(2);
const { chromium: launcher } = require(path.resolve(modules, "playwright-core"));

(async () => {
  const browser = await launcher.launch({ executablePath: chromium, args: ["--no-sandbox", "--headless=new", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"] });
  const address = "file://" + path.resolve(file).split("/").map(encodeURIComponent).join("/");
  if (what === "pictures") {
    fs.mkdirSync(folder, { recursive: true });
    for (const { name, width, height, dark, points, view } of [
      { name: "frame", width: 1440, height: 900, view: "depth" },
      { name: "points", width: 1440, height: 900, dark: true, points: true },
      { name: "phone", width: 390, height: 844 },
    ]) {
      const page = await (await browser.newContext({ viewport: { width, height }, colorScheme: dark ? "dark" : "light", reducedMotion: "reduce" })).newPage();
      await page.goto(address + "#3");
      await page.waitForTimeout(1500);
      if (view) await page.selectOption("#left", view);
      if (points) {
        await page.click("#show-points");
        await page.waitForFunction(() => document.querySelector("#point-canvas").dataset.loaded, null, { timeout: 60000 });
        for (let i = 0; i < 5; ++i) await page.keyboard.press("-"); // out of the room
        await page.focus("#point-canvas");
        for (let i = 0; i < 6; ++i) await page.keyboard.press("ArrowDown");
        await page.waitForTimeout(2500);
      }
      await page.waitForTimeout(500);
      await page.screenshot({ path: path.join(folder, `${name}.jpg`), type: "jpeg", quality: 72 });
    }
    await browser.close();
    return;
  }
  const runs = [];
  for (let i = 0; i < (what === "page" ? 5 : 1); ++i) {
    const page = await (await browser.newContext({ viewport: { width: 1440, height: 900 } })).newPage();
    await page.addInitScript(() => {
      const seen = (name) => { window.times = { ...window.times, [name]: performance.now() }; };
      new MutationObserver(() => {
        if (document.documentElement?.dataset.ready && !window.times?.ready) seen("ready");
        if (document.querySelector("#layer-right .inside") && !window.times?.images) seen("images");
        const points = document.querySelector("#point-canvas")?.dataset;
        if (points?.drawn && !window.times?.first && /^[0-9]/.test(document.querySelector("#point-readout").textContent)) seen("first");
        if (points?.loaded && !window.times?.all) seen("all");
      }).observe(document, { attributes: true, childList: true, subtree: true });
    });
    await page.goto(address);
    await page.waitForSelector("html[data-ready]");
    await page.waitForTimeout(1500);
    if (what === "page") {
      const paint = await page.evaluate(() => performance.getEntriesByName("first-contentful-paint")[0]?.startTime ?? NaN);
      const times = await page.evaluate(() => window.times);
      runs.push([paint, times.ready, times.images]);
    } else {
      await page.waitForFunction(() => window.times.all, null, { timeout: 60000 }); // the page opens at the points
      await page.waitForTimeout(1500);
      const rate = (act, seconds) => page.evaluate(async ([code, length]) => {
        const canvas = document.querySelector("#point-canvas"), before = Number(canvas.dataset.drawn), step = new Function("i", code), start = performance.now();
        for (let i = 0; performance.now() - start < 1000 * length; ++i) {
          step(i);
          const drawn = canvas.dataset.drawn;
          while (canvas.dataset.drawn === drawn) await new Promise(requestAnimationFrame);
        }
        return (Number(canvas.dataset.drawn) - before) * 1000 / (performance.now() - start);
      }, [act, seconds]);
      const all = await rate("document.querySelector('#point-size').dispatchEvent(new Event('input'))", 4);
      const moving = await rate("document.querySelector('#point-canvas').dispatchEvent(new KeyboardEvent('keydown', { key: 'ArrowLeft' }))", 4);
      const times = await page.evaluate(() => window.times);
      console.log([(times.first - times.ready).toFixed(0), (times.all - times.ready).toFixed(0), all.toFixed(1), moving.toFixed(1)].join(" | "));
    }
    await page.context().close();
  }
  if (runs.length) console.log(runs[0].map((_, i) => runs.map((run) => run[i]).sort((a, b) => a - b)[Math.floor(runs.length / 2)].toFixed(0)).join(" | "));
  await browser.close();
})().catch((failure) => {
  console.error(failure);
  process.exit(1);
});
