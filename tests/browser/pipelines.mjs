/**
 * Changes the pipelines of a running nozzle as an engineer would, in Debian's Chromium: adds a slice with completion, misspells a key,
 * puts it right by the mark, is warned of a field, is refused by the run, removes it again; by keyboard, on three sizes of page; and as
 * one who watches.
 *
 *     TOMBOLO_URL=http://127.0.0.1:7070/?token=... node tests/browser/pipelines.mjs
 *
 * The other variables are those of page.mjs.
 */
import { Viewer, check, launch, link, run } from "./page.mjs";

const browser = await launch();
const anna = await Viewer.open(browser, "anna", { colorScheme: "dark" });
const { page } = anna;
let carl = null;
const names = (viewer) => viewer.page.evaluate(() => window.tombolo.pipelines.map(({ name }) => name));
const text = () => page.evaluate(() => [...document.querySelectorAll("#pipeline-text .cm-line")].map((line) => line.textContent).join("\n"));
const checked = (state) => anna.holds(`"${state}" below the text`, (said) => document.getElementById("pipeline-state").textContent === said, state);
const options = () => page.locator(".cm-tooltip-autocomplete li").evaluateAll((found) => found.map((one) => one.querySelector(".cm-completionLabel").textContent));
/** Takes the first of what the completion offers, which begins with a text. */
const take = async (label) => {
  await anna.holds(`${label} is offered`, (begin) => document.querySelector(".cm-tooltip-autocomplete li[aria-selected]")?.textContent.startsWith(begin), label);
  // The list takes no key in its first moment.
  await page.waitForTimeout(150);
  await page.keyboard.press("Enter");
};
/** Puts the cursor behind a part of the text. */
const behind = async (part) => {
  const found = await page.evaluate((wanted) => {
    for (const line of document.querySelectorAll("#pipeline-text .cm-line")) {
      let end = line.textContent.indexOf(wanted) + wanted.length;
      if (end < wanted.length) continue;
      const walker = document.createTreeWalker(line, NodeFilter.SHOW_TEXT);
      for (let node = walker.nextNode(); node; node = walker.nextNode()) {
        if (end <= node.length) {
          getSelection().collapse(node, end);
          // Said at once: an editor that draws before it has heard of the new cursor puts the old one back.
          document.dispatchEvent(new Event("selectionchange"));
          return true;
        }
        end -= node.length;
      }
    }
    return false;
  }, part);
  check(found, `the text has no ${part}: ${await text()}`);
};
const outcome = (words) => anna.holds(`"${words}" from the run`, (said) => document.getElementById("pipeline-outcome").textContent.includes(said), words);
/** Has the messages that list the views, but for the first, come later than the frames after them. */
const listLate = (page) => page.routeWebSocket(/\/ws/, (browserSide) => {
  const server = browserSide.connectToServer();
  let isFirst = true;
  server.onMessage((message) => {
    const isList = typeof message === "string" && message.startsWith('{"hello"');
    if (isList && !isFirst) setTimeout(() => browserSide.send(message), 1500);
    else browserSide.send(message);
    if (isList) isFirst = false;
  });
});

const steps = [
  ["the list says what each pipeline does, and what it costs", async () => {
    await page.goto(link);
    await anna.until("a first picture", (seen) => seen.connection === "connected" && seen.frames > 0);
    await anna.holds("costs", () => /every 5 steps · .* a run/.test(document.querySelector('#pipelines li[data-pipeline="midplane"]')?.textContent));
    const said = await anna.text("#pipelines");
    check((await anna.text('#pipelines li[data-pipeline="midplane"]')).includes("slice across x at 0 → velocity, pressure → streamed"), said);
    check(!(await page.evaluate(() => performance.getEntriesByType("resource").some(({ name }) => /editor|language/.test(name)))), "the editor is loaded before anybody wants it");
    await page.locator("#pipelines-panel").scrollIntoViewIfNeeded();
    await anna.picture("list");
    await anna.clean("list");
  }],
  ["a slice is added from a template, with completion from the schema", async () => {
    await page.click("#pipeline-add");
    await anna.picture("templates");
    await page.click('[data-template="slice"]');
    await page.waitForSelector("#pipeline-text .cm-content");
    await checked("No errors.");
    await behind('"stream": {');
    await page.keyboard.type('"');
    await anna.holds("what a stream may say", () => document.querySelectorAll(".cm-tooltip-autocomplete li").length > 0);
    check((await options()).includes("error"), `a stream may say ${await options()}`);
    await anna.holds("what it means", () => document.querySelector(".cm-completionInfo")?.textContent.length > 20);
    await anna.picture("completion", "pipelines.png");
    await page.keyboard.press("Escape");
    check(await page.locator(".cm-tooltip-autocomplete").count() === 0, "Escape leaves the list open");
    check(await page.locator("#pipeline-editor").isVisible(), "Escape leaves the editor with the list");
    await page.keyboard.press("Control+z");
    await checked("No errors.");
    // A stage before the stream, by its name and then the names of the run's fields.
    await behind("{ \"stream\"");
    for (const key of ["ArrowUp", "End", "Enter"]) await page.keyboard.press(key);
    await page.keyboard.type('{ "sel');
    await take("select");
    await anna.holds("the fields' list", () => /"select": \{ "fields": \[/.test(document.querySelector("#pipeline-text .cm-content").textContent));
    await page.keyboard.press("Control+Space");
    await anna.holds("the run's fields", () => [...document.querySelectorAll(".cm-tooltip-autocomplete li")].some((one) => one.textContent.startsWith("pressure")));
    await anna.picture("fields");
    await page.waitForTimeout(150);
    await page.keyboard.type('"press');
    await take("pressure");
    await anna.holds("the field", () => /"fields": \["pressure"\]/.test(document.querySelector("#pipeline-text .cm-content").textContent));
    await behind('["pressure"] }');
    await page.keyboard.press("End");
    await page.keyboard.type(",");
    await checked("No errors.");
    await anna.clean("editor");
    await page.keyboard.press("Control+Enter");
    await outcome("applied at cycle");
    await anna.until("the view", ({ views }) => views.slice?.triangles > 0);
    await anna.holds("the run's list", () => {
      const names = window.tombolo.pipelines.map(({ name }) => name);
      return !names.includes(undefined) && names.includes("slice");
    });
    await anna.picture("applied");
  }],
  ["a misspelt key is marked with the nearest name, and Apply is off until it is put right", async () => {
    await behind('"normal');
    await page.keyboard.press("Backspace");
    await checked("1 error.");
    await anna.holds("the mark", () => document.querySelector(".cm-lintRange-error")?.textContent === '"norma"');
    check(/stages\[0\]\.slice\.norma: found the unknown key “norma”.*did you mean normal\?/.test(await anna.text("#pipeline-errors")), `it says ${await anna.text("#pipeline-errors")}`);
    check(await page.isDisabled("#pipeline-apply"), "Apply is on with an error");
    await page.keyboard.press("Control+Enter");
    check(!(await anna.text("#pipeline-outcome")).includes("sent"), "it was sent all the same");
    await anna.picture("misspelt");
    await anna.clean("with an error");
    await page.click('#pipeline-errors [data-act="fix"]');
    await checked("No errors.");
    check((await text()).includes('"normal"'), `the text is ${await text()}`);
  }],
  ["a field that nobody has is warned of with the nearest name, and the run has the last word", async () => {
    await behind('"pressure');
    await page.keyboard.press("Backspace");
    await checked("No errors, 1 warning.");
    await anna.holds("the mark", () => document.querySelector(".cm-lintRange-warning")?.textContent === '"pressur"');
    check(/select\.fields\[0\]: neither the run nor a stage before has a field “pressur”; did you mean pressure\?/.test(await anna.text("#pipeline-errors .warning")), `it says ${await anna.text("#pipeline-errors")}`);
    check(await page.isEnabled("#pipeline-apply"), "a warning keeps the pipeline from being applied");
    await page.keyboard.press("F8");
    await anna.holds("the warning at the cursor", () => /neither the run/.test(document.querySelector(".cm-panel-lint, .cm-tooltip-lint, .cm-diagnostic-warning")?.textContent ?? ""));
    await anna.picture("warned");
    await anna.clean("with a warning");
    await page.keyboard.press("Control+Enter");
    await outcome("The run refused it:");
    await anna.holds("the mark", () => document.querySelector(".cm-lintRange-error")?.textContent === '"pressur"');
    check(await page.locator("#pipeline-errors li").count() === 1, `it says twice ${await anna.text("#pipeline-errors")}`);
    await checked("Refused by the run.");
    await anna.picture("refused");
    await page.click('#pipeline-errors [data-act="fix"]');
    await checked("No errors.");
    check(await page.isDisabled("#pipeline-apply"), "what is there already can be applied again");
  }],
  ["a field that an earlier stage derives is completed, and not warned of", async () => {
    await behind('"stages": [');
    await page.keyboard.press("Enter");
    await page.keyboard.type('{ "gradient": { "field": "pressure", "name": "slope" } },');
    await checked("No errors.");
    await behind('["pressure"');
    await page.keyboard.type(', "slo');
    await anna.holds("the derived field", () => /^slope.*field/.test(document.querySelector(".cm-tooltip-autocomplete li")?.textContent));
    await anna.picture("derived");
    await take("slope");
    await checked("No errors.");
    check((await text()).includes('["pressure", "slope"]'), `the text is ${await text()}`);
    await page.click("#pipeline-revert");
    await checked("No errors.");
  }],
  ["a draft is kept when the editor is left, Tab leaves the text, and all is reached by keyboard", async () => {
    await page.keyboard.press("Escape");
    check(await page.evaluate(() => document.activeElement.closest("li")?.dataset.pipeline) === "slice", "the focus is not on the row");
    await page.keyboard.press("Enter");
    await page.waitForSelector("#pipeline-text .cm-content");
    await anna.holds("the cursor in the text", () => document.activeElement?.classList.contains("cm-content"));
    await behind('"steps": ');
    await page.keyboard.type("1");
    await page.keyboard.press("Tab");
    check(!(await page.evaluate(() => document.activeElement.classList.contains("cm-content"))), "Tab stays in the text");
    await page.keyboard.press("Escape");
    check(/draft/.test(await anna.text('#pipelines li[data-pipeline="slice"]')), "the draft is not told of");
    await page.keyboard.press("Enter");
    await checked("No errors.");
    check((await text()).includes('"steps": 15'), `the draft is lost: ${await text()}`);
    await page.click("#pipeline-revert");
    await page.keyboard.press("Escape");
  }],
  ["the editor fits on a wide page and a narrow one, in light and in dark", async () => {
    for (const [width, height] of [[1920, 1080], [820, 1180]]) {
      await page.setViewportSize({ width, height });
      if (width < 1100 && await page.getAttribute("#left-drawer", "aria-expanded") !== "true") await page.click("#left-drawer");
      await page.click('#pipelines li[data-pipeline="health"] .load');
      await anna.holds("the cursor in the text", () => document.activeElement?.classList.contains("cm-content"));
      await checked("No errors.");
      const inside = await page.evaluate(() => [...document.querySelectorAll("#pipeline-editor, #pipeline-editor button")].filter((one) => one.checkVisibility()).every((one) => {
        const [{ left, right }, aside] = [one.getBoundingClientRect(), document.getElementById("left").getBoundingClientRect()];
        return left >= aside.left && right <= aside.right && right <= innerWidth;
      }));
      check(inside, `something stands out of the panel at ${width}`);
      await anna.picture(`editor-${width}`);
      await page.keyboard.press("Escape");
      if (width < 1100) {
        check(await page.locator("#left").isVisible(), "Escape in the editor closes the drawer");
        await page.click("#left-drawer");
      }
    }
    await page.setViewportSize({ width: 1280, height: 800 });
    await page.click("#theme");
    await page.click('#pipelines li[data-pipeline="health"] .load');
    await checked("No errors.");
    await anna.clean("light");
    await anna.picture("light");
    await page.keyboard.press("Escape");
  }],
  ["one who watches reads, and changes nothing", async () => {
    await page.context().grantPermissions(["clipboard-read", "clipboard-write"]);
    await page.click("#viewers");
    await page.click("#link-watch");
    await anna.holds("a link", () => !document.getElementById("link-told").hidden);
    const address = await page.evaluate(() => navigator.clipboard.readText());
    await page.keyboard.press("Escape");
    carl = await Viewer.open(browser, "carl");
    await listLate(carl.page);
    await carl.page.goto(address);
    await carl.until("a picture", (seen) => seen.connection === "connected" && seen.frames > 0);
    check(await carl.page.isDisabled("#pipeline-add"), "a watcher may add");
    await carl.page.click('#pipelines li[data-pipeline="slice"] [data-act="remove"]', { force: true });
    check(await carl.page.locator("#pipelines .question").count() === 0, "a watcher may remove");
    await carl.page.click('#pipelines li[data-pipeline="slice"] .load');
    await carl.page.waitForSelector("#pipeline-text .cm-content");
    await carl.page.click("#pipeline-text .cm-content");
    const before = await carl.text("#pipeline-text .cm-content");
    await carl.page.keyboard.type("x");
    check(await carl.text("#pipeline-text .cm-content") === before, "a watcher may write");
    check(await carl.page.isDisabled("#pipeline-apply"), "a watcher may apply");
    await carl.picture("watching");
    await carl.clean("watching");
  }],
  ["a view is seen whose first frame comes before the view is listed", async () => {
    await page.click('#pipelines li[data-pipeline="slice"] [data-act="duplicate"]');
    await page.waitForSelector("#pipeline-text .cm-content");
    await checked("No errors.");
    await page.keyboard.press("Control+Enter");
    await outcome("applied at cycle");
    await carl.until("the view", ({ views }) => views["slice 2"]?.triangles > 0);
    await page.keyboard.press("Escape");
  }],
  ["a pipeline is removed once that is confirmed", async () => {
    await page.click('#pipelines li[data-pipeline="slice"] [data-act="remove"]');
    await anna.picture("question");
    await anna.clean("question");
    await page.click('#pipelines li[data-pipeline="slice"] [data-act="remove"]');
    await outcome("slice is removed at cycle");
    await anna.holds("a list without it", () => !window.tombolo.pipelines.some(({ name }) => name === "slice"));
    await carl.holds("the watcher's too", () => !window.tombolo.pipelines.some(({ name }) => name === "slice"));
    await anna.picture("removed");
  }],
  ["nothing went wrong on the way", async () => {
    const complaints = [anna, carl].flatMap((viewer) => viewer.complaints);
    check(complaints.length === 0, complaints.join("\n"));
  }],
];

await run(steps, () => [anna, carl].filter(Boolean), () => browser.close());
