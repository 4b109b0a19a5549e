/**
 * Measures the viewer in Debian's Chromium, watching the run at TOMBOLO_URL, and prints one line of JSON: seconds and bytes. Frames are
 * timed from their arrival to the picture, which is turned while they come, by keys and by the mouse; the throat, where there is one, is
 * dragged; the heap is looked at before and after.
 */
import { heap, link, openBrowser } from "./browser.mjs";

const FRAMES = 150, SHOWN = 40, DRAGS = 60, HEAP_SECONDS = 30, BROWSER_SECONDS = 2, HANDLE = "throat";

const sorted = (list) => [...list].sort((a, b) => a - b);
const spread = (list) => ({ median: sorted(list)[list.length >> 1], late: sorted(list)[Math.floor(0.95 * (list.length - 1))] });

const browser = await openBrowser();
try {
  const page = await browser.newPage({ viewport: { width: 1280, height: 800 } });
  page.setDefaultTimeout(120_000);
  const network = await page.context().newCDPSession(page);
  await network.send("Network.enable");
  // The files of the viewer; what the run tells beside them grows with its mesh.
  let wire = 0;
  const files = new Set();
  network.on("Network.responseReceived", ({ requestId, response }) => {
    if (/\/$|\.(html|js|css|wasm|svg|png|ico)$/.test(new URL(response.url).pathname)) files.add(requestId);
  });
  network.on("Network.loadingFinished", ({ requestId, encodedDataLength }) => { if (files.has(requestId)) wire += encodedDataLength; });
  await page.addInitScript(() => {
    window.longest = 0;
    new PerformanceObserver((list) => { for (const task of list.getEntries()) window.longest = Math.max(window.longest, task.duration); }).observe({ type: "longtask" });
    const look = () => {
      if (window.tombolo?.frames > 0) {
        void window.tombolo.picture().then(() => { window.firstPicture = performance.now(); });
      } else requestAnimationFrame(look);
    };
    requestAnimationFrame(look);

    // How long a frame takes from its arrival: to its values in the picture that the browser draws next, and to the picture after that.
    window.shown = [];
    let arrived = null;
    window.WebSocket = class extends WebSocket {
      constructor(...all) {
        super(...all);
        this.addEventListener("message", ({ data }) => {
          if (data instanceof ArrayBuffer) arrived ??= { at: performance.now(), frames: window.tombolo?.frames ?? 0 };
        });
      }
    };
    const time = () => {
      if (arrived && window.tombolo?.frames > arrived.frames) {
        const { at } = arrived;
        arrived = null;
        requestAnimationFrame((next) => { window.shown.push((next - at) / 1000); });
      }
      requestAnimationFrame(time);
    };
    requestAnimationFrame(time);
  });
  // A browser that was only just started is busy with itself: the page is opened in one that is there already.
  await page.waitForTimeout(BROWSER_SECONDS * 1000);
  await page.goto(link);
  const firstPicture = await (await page.waitForFunction(() => window.firstPicture)).jsonValue();
  await page.waitForTimeout(1000);
  const triangles = await page.evaluate(() => Object.values(window.tombolo.views).reduce((sum, view) => sum + view.triangles, 0));

  await page.evaluate(() => { window.shown = []; });
  await page.waitForFunction((count) => window.shown.length >= count, SHOWN);
  const shown = await page.evaluate(() => window.shown);

  /** How long frames take, and how many cycles come in one: a viewer that shows no new values would be quick. */
  const watch = (frames, isByKey) => page.evaluate(async ([count, isTurning]) => {
    const scene = document.getElementById("scene");
    const next = () => new Promise((resolve) => { requestAnimationFrame(resolve); });
    const times = [];
    let last = await next();
    const before = window.tombolo.frames;
    // A large case takes a while for a step.
    for (let i = 0; i < count || (i < 50 * count && window.tombolo.frames === before); i++) {
      if (isTurning) scene.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowLeft", bubbles: true }));
      const now = await next();
      times.push((now - last) / 1000);
      last = now;
    }
    const came = window.tombolo.frames - before;
    if (came === 0) throw new Error("no frames came while the picture was turned");
    return { times, came: came / times.length };
  }, [frames, isByKey]);
  await watch(20, true);
  await page.evaluate(() => { window.longest = 0; });
  const byKeys = await watch(FRAMES, true);
  const longestTask = await page.evaluate(() => window.longest / 1000);

  // Where nothing lies under the pointer, so that it turns the picture.
  const scene = await page.locator("#scene").boundingBox();
  const [left, top] = [scene.x + 0.1 * scene.width, scene.y + 0.4 * scene.height];
  const camera = () => page.evaluate(() => JSON.stringify(window.tombolo.camera));
  const stood = await camera();
  await page.mouse.move(left, top);
  await page.mouse.down();
  let isWatched = true;
  const watched = watch(FRAMES, false).finally(() => { isWatched = false; });
  for (let step = 0; isWatched; step++) await page.mouse.move(left + 3 * (step % 100), top + (step % 50));
  const byMouse = await watched;
  await page.mouse.up();
  if (await camera() === stood) throw new Error("the mouse did not turn the picture");

  let firstPreview = null, dragging = null;
  await page.click('[data-camera="0"]');
  const place = await page.evaluate(async (name) => {
    await window.tombolo.picture();
    return window.tombolo.featurePlace(name);
  }, HANDLE);
  if (place) {
    const drawn = () => page.waitForFunction(() => {
      const { state, milliseconds, reason } = window.tombolo.preview;
      if (state === "failed") throw new Error(reason);
      return state === "shown" && milliseconds;
    }, null, { polling: 5 });
    const times = [];
    await page.keyboard.down("Control");
    await page.mouse.move(...place);
    await page.mouse.down();
    for (let step = 1; step <= DRAGS; step++) {
      await page.mouse.move(place[0] + 2 * step, place[1] - step);
      times.push(await (await drawn()).jsonValue() / 1000);
    }
    await page.mouse.up();
    await page.keyboard.up("Control");
    firstPreview = times[0];
    dragging = spread(times.slice(1));
    await page.keyboard.press("Escape");
    if (await page.locator("#cancel").isVisible()) await page.click("#cancel");
  }

  await page.waitForTimeout(3000);
  const { held: before } = await heap(page);
  await page.waitForTimeout(HEAP_SECONDS * 1000);
  const heapGrowth = (await heap(page)).held - before;

  console.log(JSON.stringify({
    triangles, first_picture: firstPicture / 1000, wire, shown: spread(shown), rotating: spread(byKeys.times), frames_with_values: byKeys.came,
    rotating_by_mouse: spread(byMouse.times), longest_task: longestTask, first_preview: firstPreview, dragging, heap_growth: heapGrowth,
  }));
} finally {
  await browser.close();
}
