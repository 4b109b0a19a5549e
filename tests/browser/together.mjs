/**
 * Looks at a running nozzle as three people would together, in Debian's Chromium: links for others, names, the wheel handed on by
 * name, the camera of the one who steers followed, notes pinned to a place.
 *
 *     TOMBOLO_URL=http://127.0.0.1:7070/?token=... node tests/browser/together.mjs
 *
 * The other variables are those of page.mjs.
 */
import { Failure, Viewer, check, launch, link, run } from "./page.mjs";

const browser = await launch();
const anna = await Viewer.open(browser, "anna");
let [bo, carl] = [null, null];
const there = () => [anna, bo, carl].filter(Boolean);
const now = (viewer) => viewer.page.evaluate(() => {
  const { people, notes, following, camera } = window.tombolo;
  return { people, notes, following, camera };
});
const known = (viewer, what, condition, argument) => viewer.holds(what, condition, argument);
/** The link that a button of the page has copied. */
const copied = async (viewer, button) => {
  await viewer.page.evaluate(() => navigator.clipboard.writeText(""));
  await viewer.page.click(button);
  await viewer.holds("a copied link", () => !document.getElementById("link-told").hidden);
  const words = await viewer.text("#link-told");
  check(/^Copied\. It opens one browser, once/.test(words), `the page says "${words}"`);
  return viewer.page.evaluate(() => navigator.clipboard.readText());
};
/** Another person, who opens a link. */
const opened = async (name, address, size) => {
  const viewer = await Viewer.open(browser, name, { viewport: size });
  await viewer.page.goto(address);
  await viewer.until("a picture", (seen) => seen.connection === "connected" && seen.frames > 0);
  return viewer;
};
const called = async (viewer, name) => {
  if (await viewer.page.locator("#people").isHidden()) await viewer.page.click("#viewers");
  await viewer.page.fill("#own-name", name);
  await viewer.page.press("#own-name", "Tab");
};

const steps = [
  ["a link is copied for one who may steer, and for one who watches", async () => {
    await anna.page.context().grantPermissions(["clipboard-read", "clipboard-write"]);
    await anna.page.goto(link);
    await anna.until("a first picture", (seen) => seen.connection === "connected" && seen.frames > 0);
    await anna.page.click("#viewers");
    const steering = await copied(anna, "#link-drive");
    const watching = await copied(anna, "#link-watch");
    await anna.picture("links");
    await anna.clean("with links");
    for (const address of [steering, watching]) check(new RegExp(`^${new URL(link).origin}/\\?key=[0-9a-f]{32}$`).test(address), `the link is ${address}`);
    bo = await opened("bo", steering, { width: 1920, height: 1080 });
    carl = await opened("carl", watching, { width: 820, height: 1180 });
    for (const [viewer, mayAsk] of [[bo, true], [carl, false]]) {
      check(await viewer.page.locator("#wheel").isVisible() === mayAsk, `${viewer.name} ${mayAsk ? "cannot" : "can"} ask to steer`);
      check(!viewer.page.url().includes("key="), `the key stays in the address of ${viewer.name}`);
    }
    const again = await browser.newContext();
    const answer = await (await again.newPage()).goto(steering);
    check(answer.status() === 401, `a link that was used is answered with ${answer.status()}`);
    await again.close();
  }],
  ["without a clipboard the link is shown, selected, and goes with the panel", async () => {
    await carl.page.evaluate(() => Object.defineProperty(navigator, "clipboard", { value: undefined }));
    await carl.page.click("#viewers");
    check(await carl.page.locator("#link-drive").isDisabled(), "one who watches is offered a link for steering");
    await carl.page.click("#link-watch");
    await carl.page.waitForSelector("#link-text:not([hidden])");
    const selected = await carl.page.evaluate(() => window.getSelection().toString() || document.activeElement.value.slice(document.activeElement.selectionStart, document.activeElement.selectionEnd));
    check(/\?key=[0-9a-f]{32}$/.test(selected), `"${selected}" is selected`);
    await carl.picture("link-shown");
    await carl.clean("with a link shown");
    await carl.page.keyboard.press("Escape");
    check(await carl.page.inputValue("#link-text") === "", "the link is left there");
    check(await carl.page.evaluate(() => document.activeElement.id) === "viewers", "the focus is lost with the panel");
  }],
  ["names are told, as text alone, and the wheel is asked for and handed on by name", async () => {
    await called(anna, "Anna");
    await called(bo, "<i>Bo</i>");
    await called(carl, "Carl");
    for (const viewer of there()) {
      await known(viewer, "three names", () => JSON.stringify(window.tombolo.people.map(({ name }) => name)) === JSON.stringify(["Anna", "<i>Bo</i>", "Carl"]));
      check(await viewer.page.locator("#people-list i").count() === 0, "a name was taken for markup");
    }
    check(/^watching · Anna \(c\d+\) steers$/.test(await bo.text("#role")), `the bar says "${await bo.text("#role")}"`);
    await bo.page.click("#people-close");
    // So that the driver is not taken for gone, however long the other pages took.
    await anna.page.mouse.move(5, 5);
    await bo.page.click("#wheel");
    await anna.page.waitForSelector("#asked:not([hidden])");
    check(/^<i>Bo<\/i> \(c\d+\) asks to steer\.$/.test(await anna.text("#asked-text")), `the page says "${await anna.text("#asked-text")}"`);
    await known(bo, "that the answer is waited for", () => !document.getElementById("waiting").hidden && /is told that you ask/.test(document.getElementById("waiting").textContent));
    check(await bo.page.locator("#refusal").isHidden(), "to have to wait counts as an error");
    await anna.picture("people");
    await anna.clean("asked");
    const small = await anna.small();
    check(small.length === 0, `with the people shown these are smaller than 24 px: ${small.join(", ")}`);
    await anna.page.click('#people-list li:nth-child(2) [data-act="hand-over"]');
    await bo.until("the wheel", (seen) => seen.role === "driver");
    check(await bo.page.locator("#waiting").isHidden(), "an answer is still waited for");
    check(await anna.page.locator('#people-list [data-act="hand-over"]').count() === 0, "one who watches can hand the wheel over");
    await bo.page.click("#viewers");
    await bo.page.click('#people-list li:nth-child(1) [data-act="hand-over"]');
    await anna.until("the wheel", (seen) => seen.role === "driver");
    // A reload keeps the name.
    await bo.page.reload();
    await known(anna, "the name after a reload", () => window.tombolo.people.some(({ name }) => name === "<i>Bo</i>"));
    await bo.until("a picture", (seen) => seen.connection === "connected" && seen.frames > 0);
  }],
  ["the camera of the one who steers is followed until somebody turns the picture", async () => {
    await carl.page.check("#follow");
    await known(carl, "following", () => window.tombolo.following);
    for (const key of ["x", "c", "z"]) {
      await anna.page.focus("#scene");
      await anna.page.keyboard.press(key);
      // Where its middle is drawn is each picture's own: it depends on what lies over it.
      const { middle, ...camera } = (await now(anna)).camera;
      await known(carl, `the camera after ${key}`, (wanted) => {
        const { middle, ...camera } = window.tombolo.camera;
        return JSON.stringify(camera) === JSON.stringify(wanted);
      }, camera);
    }
    check((await now(carl)).following, "it is not followed any more though nobody has turned the picture");
    const before = (await now(bo)).camera;
    await carl.picture("follows");
    await anna.picture("is-followed");
    await carl.clean("following");
    await carl.page.focus("#scene");
    await carl.page.keyboard.press("ArrowLeft");
    await known(carl, "following no more", () => !window.tombolo.following && !document.getElementById("follow").checked);
    const own = (await now(carl)).camera;
    await anna.page.keyboard.press("y");
    await anna.page.waitForTimeout(1000);
    check(JSON.stringify((await now(carl)).camera) === JSON.stringify(own), "the camera goes on being followed");
    check(JSON.stringify((await now(bo)).camera) === JSON.stringify(before), "the camera of one who does not follow was moved");
    await carl.page.click("#people-close");
    await anna.page.click("#people-close");
    await anna.page.click('[data-camera="reset"]');
  }],
  ["notes are pinned to places, seen by all, flown to and taken away", async () => {
    // One tool at a time takes clicks.
    const pressed = () => anna.page.evaluate(() => ["ruler", "line", "note"].filter((id) => document.getElementById(id).getAttribute("aria-pressed") === "true"));
    for (const tool of ["ruler", "note", "line", "note"]) {
      await anna.page.click(`#${tool}`);
      check((await pressed()).join() === tool, `${await pressed()} take clicks instead of ${tool}`);
    }
    const [x, y] = await anna.place("throat");
    await anna.page.mouse.click(x, y);
    check(await anna.page.evaluate(() => document.activeElement.id) === "note-text", "the text of the note has not the focus");
    await anna.page.keyboard.type("separates <b>here</b>");
    await anna.page.keyboard.press("Enter");
    for (const viewer of there()) await known(viewer, "the note", () => window.tombolo.notes.length === 1);
    const [note] = (await now(carl)).notes;
    const box = await anna.page.evaluate(() => window.tombolo.featureBounds("throat"));
    check([0, 1, 2].every((k) => note.at[k] > box[0][k] - 0.01 && note.at[k] < box[1][k] + 0.01), `the note is at ${note.at}, the throat in ${JSON.stringify(box)}`);
    check(note.by === "Anna" && note.text === "separates <b>here</b>" && note.cycle > 0, `the note is ${JSON.stringify(note)}`);
    // By the keyboard alone, by one who could steer and does not.
    await bo.page.focus("#note-text");
    await bo.page.keyboard.type("and this too");
    await bo.page.keyboard.press("Enter");
    await known(anna, "the second note", () => window.tombolo.notes.length === 2);
    check(await anna.page.locator("#notes b").count() === 0, "a note was taken for markup");
    check(await anna.page.locator("#marks circle.note").count() === 2, "the pins are not in the picture");
    await anna.picture("notes");
    await bo.picture("notes");
    await anna.clean("with notes");
    await carl.page.click("#left-drawer");
    check(await carl.page.locator("#note-form").isHidden() && await carl.page.locator('#notes [data-act="remove"]').count() === 0, "one who watches can write notes");
    const before = (await now(carl)).camera;
    await carl.page.click("#notes li:nth-child(1) .load");
    await known(carl, "the camera at the note", (at) => JSON.stringify(window.tombolo.camera.focalPoint) === JSON.stringify(at), note.at);
    check(JSON.stringify(before) !== JSON.stringify((await now(carl)).camera), "the camera did not move");
    await carl.picture("note-flown-to");
    await carl.clean("with notes in a drawer");
    // One who comes later sees them.
    await bo.page.reload();
    await known(bo, "the notes after a reload", () => window.tombolo?.notes.length === 2);
    await bo.page.click('#notes li:nth-child(1) [data-act="remove"]');
    for (const viewer of there()) await known(viewer, "one note less", () => window.tombolo.notes.length === 1);
  }],
  ["one who is removed is told so", async () => {
    await anna.page.click("#viewers");
    await anna.page.click('#people-list li:has-text("Carl") [data-act="remove"]');
    await carl.until("the end of the connection", (seen) => seen.connection === "dismissed");
    check(/has ended this connection/.test(await carl.text("#banner")), `the banner says "${await carl.text("#banner")}"`);
    await known(anna, "two people", () => window.tombolo.people.length === 2);
  }],
  ["nothing went wrong on the way", async () => {
    const complaints = there().flatMap((viewer) => viewer.complaints);
    if (complaints.length > 0) throw new Failure(complaints.join("\n"));
  }],
];

await run(steps, there, () => browser.close());
