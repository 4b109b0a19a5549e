/** Puts the parts together: messages in, orders out. */
import { Connection, streamAddress } from "./connection/connection";
import { InputError } from "./form/controls";
import { Decoder } from "./connection/decoder";
import { watchDrags } from "./picture/drag";
import type { DecodeWorker } from "./connection/decoder";
import { part, write } from "./dom";
import { Forecasts } from "./preview/forecast";
import { EditForm } from "./form/form";
import { compileKernel } from "./kernel/kernel";
import { showLayers } from "./panels/layers";
import { publish } from "./inspection";
import { Orders } from "./panels/orders";
import { ScalarBar, Triad, showEmpty } from "./picture/overlay";
import { watchPointer } from "./picture/pointer";
import { PreviewPanel } from "./preview/preview-panel";
import type { ClientMessage, Frame, Hello, Json, ServerMessage, Status } from "./connection/protocol";
import { Scene } from "./picture/scene";
import { Selection } from "./store/selection";
import { ColourPanel } from "./panels/colours";
import { MonitorPanel } from "./panels/monitors";
import { ParameterPanel } from "./panels/parameters";
import { ViewList } from "./panels/views";
import { StatusBar } from "./panels/status";
import { Wheel } from "./panels/wheel";

if (!document.createElement("canvas").getContext("webgl2")) {
  showEmpty("This browser cannot draw the picture", "It has no WebGL 2, or it is switched off. Any current Chrome, Firefox, Edge or Safari has it.");
  throw new Error("WebGL 2 is missing");
}

let hello: Hello | null = null;
let status: Status | null = null;
let cycle: number | null = null;
let frames = 0;
let sequence = 0;
let everConnected = false;
let fresh = false;
let stack = "";
let orderSchema: Json | null = null;
let isLoadingSchema = false;
let noticed = 0;
const errors: string[] = [];
const session = Array.from(crypto.getRandomValues(new Uint8Array(4)), (byte) => byte.toString(16).padStart(2, "0")).join("");

/** The kernel decodes the frames and computes the previews: it is fetched once, at once. */
const kernel = compileKernel();
const selection = new Selection();
const scalarBar = new ScalarBar();
const triad = new Triad();
const scene = new Scene(part("scene"), selection, {
  range: (range) => {
    scalarBar.range(range);
    colours.setRange(range);
  },
  drawn: (axes) => triad.turn(axes),
  trouble: report,
});
const views = new ViewList(part("views"), scene);
const colours = new ColourPanel(scene, (colouring, map) => scalarBar.describe(colouring, map, hello?.fields ?? []));
const monitors = new MonitorPanel(part("monitors"));
const parameters = new ParameterPanel(part("parameters"), (name, value) => send({ parameter: { name, value } }), showProblem);
const form = new EditForm(part("fields"), selection);
const orders = new Orders(part("orders"), (text) => write(part("announcer"), text), (order) => send({ cancel: { order } }));
const bar = new StatusBar();
const wheel = new Wheel(send, () => connection.state === "connected" && hello?.role === "driver");
watchPointer(part("scene"), scene, selection);
const addresses = streamAddress(window.location.href);
const preview = new PreviewPanel(scene, addresses.surface, kernel, () => {
  const { edits } = form.read();
  return Array.isArray(edits) ? edits : [];
});

const forecasts = new Forecasts(
  (order) => (hello?.role === "driver" && connection.state === "connected" && status?.stopped !== true ? ask({ forecast: order }) : null),
  (tone, text) => {
    const notice = part("forecast");
    notice.hidden = text === "";
    notice.dataset.tone = tone;
    write(notice, text);
  },
);

/** The order in the form, once it asks for anything. */
function wished(): Json | null {
  if (preview.inspect().state === "none") return null;
  try {
    return form.read();
  } catch (error) {
    if (!(error instanceof InputError)) throw error;
    return null;
  }
}

/** What stands in the form is another order. */
function composed(): void {
  preview.changed();
  forecasts.changed(wished());
}

const worker = new Worker(new URL("./connection/decode.worker.ts", import.meta.url), { type: "module" });
kernel.then((module) => worker.postMessage({ module }), (error: unknown) => report(String(error)));
const decoder = new Decoder(worker as unknown as DecodeWorker, {
  frame: takeFrame,
  decoded: (count) => connection.acknowledge(count),
  lost: (reason) => connection.renew(`A frame could not be read: ${reason}.`),
});

const connection = new Connection(addresses, {
  state: (state, explanation) => {
    bar.connection(state, explanation);
    if (state === "connected") fresh = true;
    else decoder.clear();
    refresh();
  },
  message: takeMessage,
  binary: (bytes) => {
    bar.alive();
    decoder.push(bytes);
  },
  trouble: report,
});

const CLIENT = "tombolo-client", BACK = "tombolo-back";
const [client, back] = [sessionStorage.getItem(CLIENT), sessionStorage.getItem(BACK)];
connection.identity = client !== null && back !== null ? { client, back } : null;

function takeMessage(message: ServerMessage): void {
  bar.alive();
  switch (message.kind) {
    case "hello": return takeHello(message.body);
    case "status":
      status = message.body;
      bar.update(status);
      if (hello) bar.role(hello, status.driver);
      return refresh();
    case "order": return orders.update(message.body);
    case "forecast": return forecasts.answer(message.body, status?.quality ?? null);
    case "monitor": return monitors.update(message.body);
    // The hello that comes with it says what there is now.
    case "pipelines": return;
    // The status shows what it has changed.
    case "done": return;
    case "wheel": return wheel.asked(message.body.asked_by);
    case "end": return bar.end(message.body);
    case "error": {
      const { id, message: text } = message.body;
      if (!(id && (orders.refused(id, text) || forecasts.refused(id, text)))) showProblem(text);
    }
  }
}

function takeHello(body: Hello): void {
  hello = body;
  connection.identity = { client: String(body.client), back: body.back ?? "" };
  sessionStorage.setItem(CLIENT, connection.identity.client);
  sessionStorage.setItem(BACK, connection.identity.back);
  const names = body.features.map((feature) => feature.name);
  write(part("channel"), body.channel ?? "");
  scene.setViews(body.views);
  scene.setFeatures(names);
  selection.keep(names);
  views.set(body.views);
  colours.set(body.fields);
  showForm(body);
  const moved = JSON.stringify(body.stack) !== stack;
  stack = JSON.stringify(body.stack);
  preview.set(body.surface ?? null, body.stack);
  if (moved) forecasts.outdated(wished());
  parameters.set(body.parameters, body.role === "driver");
  orders.reconcile(body.orders, fresh && everConnected);
  fresh = false;
  everConnected = true;
  showLayers(part("stack"), body.stack, (stack) => {
    showProblem("");
    sendOrder({ stack });
  });
  part("stack-empty").hidden = body.stack.length > 0;
  bar.role(body, status?.driver);
  refresh();
}

/** Asks for what an order may hold, which no hello says: it is long and stays the same. */
async function loadSchema(): Promise<void> {
  if (isLoadingSchema) return;
  isLoadingSchema = true;
  try {
    const response = await fetch(addresses.schema, { cache: "no-store", redirect: "error" });
    if (!response.ok) throw new Error(response.statusText);
    orderSchema = await response.json() as Json;
    if (hello) showForm(hello);
  } catch (error) {
    report(`what an order may hold: ${String(error)}`);
  } finally {
    isLoadingSchema = false;
  }
}

function showForm(body: Hello): void {
  if (orderSchema === null) return void loadSchema();
  form.setSchema(orderSchema, body.defaults);
  form.setFeatures(body.features);
}

function takeFrame(frame: Frame): void {
  if (frame.kind === "topology") {
    scene.setTopology(frame);
  } else if (scene.setData(frame)) {
    frames++;
    cycle = frame.cycle;
    if (frames === 1) refresh();
  }
}

/** Something that arrived could not be read; the viewer goes on with what it has. */
function report(text: string): void {
  errors.push(text);
  if (errors.length > 50) errors.shift();
  const notice = part("notice");
  write(notice, `Something that arrived could not be read: ${text}.`);
  notice.hidden = false;
  clearTimeout(noticed);
  noticed = window.setTimeout(() => { notice.hidden = true; }, 10000);
}

function refresh(): void {
  const connected = connection.state === "connected";
  const driving = connected && hello?.role === "driver";
  const stopped = status?.stopped === true;
  (part("apply") as HTMLButtonElement).disabled = !driving || stopped;
  (part("undo") as HTMLButtonElement).disabled = !driving || stopped;
  const pause = part("pause") as HTMLButtonElement;
  pause.disabled = !driving || stopped;
  write(pause, status?.paused ? "Resume" : "Pause");
  pause.dataset.paused = String(status?.paused === true);
  orders.allowCancelling(driving && !stopped);
  part("wheel").hidden = !connected || !hello || driving || hello.may_drive === false;
  wheel.refresh();
  if (frames > 0) return showEmpty("", "");
  if (connection.state === "refused") showEmpty("This link does not open the simulation", "It was used already, or is of another run. Open a link that this simulation told when it started.");
  else if (!connected) showEmpty("Waiting for the simulation", "Nothing answers at this address yet. The viewer connects by itself as soon as the run is there.");
  else if (hello && hello.views.length === 0) showEmpty("Nothing is streamed", "The simulation runs, but no pipeline of its configuration ends in a stream stage.");
  else showEmpty("Connected", "The first picture appears when the simulation has taken its next step.");
}

function showProblem(text: string): void {
  const problem = part("problem");
  write(problem, text);
  problem.hidden = text === "";
}

/** Sends a message, and says under what name; null where there is no connection. */
function ask(message: ClientMessage): string | null {
  const id = `${session}-${++sequence}`;
  return connection.send({ id, ...message }) ? id : null;
}

function send(message: ClientMessage): string | null {
  const id = ask(message);
  if (id) return id;
  showProblem("There is no connection to the simulation; nothing was sent.");
  return null;
}

function sendOrder(order: Json): void {
  const id = send({ order });
  if (id) orders.sent(id, order);
}

part("edit").addEventListener("submit", (event) => {
  event.preventDefault();
  showProblem("");
  try {
    sendOrder(form.read());
    preview.clear();
    forecasts.clear();
  } catch (error) {
    if (!(error instanceof InputError)) throw error;
    showProblem(error.message);
    error.field?.focus();
  }
});
part("undo").addEventListener("click", () => {
  showProblem("");
  sendOrder({ undo: 1 });
});
part("pause").addEventListener("click", () => send(status?.paused ? { resume: {} } : { pause: {} }));
part("wheel").addEventListener("click", () => send({ drive: {} }));
part("retry").addEventListener("click", () => connection.retry());
window.addEventListener("online", () => { if (connection.state !== "dismissed") connection.retry(); });

let side: 1 | -1 = 1;
let looking = "";
part("tools").addEventListener("click", (event) => {
  const button = (event.target as HTMLElement).closest("button");
  const camera = button?.dataset.camera;
  if (!button || !camera) return;
  if (camera === "reset") scene.reset();
  else if (camera === "parallel") {
    scene.parallel = !scene.parallel;
    button.setAttribute("aria-pressed", String(scene.parallel));
  } else {
    side = looking === camera ? (side === 1 ? -1 : 1) : camera === "1" ? -1 : 1;
    scene.axis(Number(camera) as 0 | 1 | 2, side);
  }
  looking = camera;
});

part("edit").addEventListener("input", () => {
  // What was wrong when Apply was pressed may be mended now.
  showProblem("");
  composed();
});
part("edit").addEventListener("change", composed);
part("cancel").addEventListener("click", () => {
  preview.clear();
  forecasts.clear();
});
selection.onChange(() => {
  preview.chosen();
  forecasts.changed(wished());
});
watchDrags(part("stage"), scene, selection, (by, node) => {
  if (node ? form.compose("skeleton", { at: node, by }) : form.compose("translate", { by })) composed();
});
part("skeleton").addEventListener("click", (event) => {
  const button = event.currentTarget as HTMLButtonElement;
  const shown = button.getAttribute("aria-pressed") !== "true";
  button.setAttribute("aria-pressed", String(shown));
  preview.showSkeleton(shown);
});

publish({
  get connection() { return connection.state; },
  get role() { return hello?.role ?? null; },
  get cycle() { return cycle; },
  get frames() { return frames; },
  get views() {
    return Object.fromEntries([...scene.layers].map(([name, layer]) => [name, {
      bounds: scene.viewBounds(name), points: layer.topology?.points ?? 0,
      triangles: (layer.topology?.triangles.length ?? 0) / 3, topology: layer.topology?.topology ?? null,
    }]));
  },
  get orders() { return orders.all(); },
  get status() { return status && structuredClone(status); },
  get quality() { return status?.quality ? { ...status.quality } : null; },
  get stack() { return structuredClone(hello?.stack ?? []); },
  get selection() {
    const names = hello?.features.map((feature) => feature.name) ?? [];
    return { handle: selection.chosen("handle", names), fixed: selection.chosen("fixed", names) };
  },
  get preview() { return preview.inspect(); },
  get forecast() { return forecasts.inspect(); },
  get errors() { return [...errors]; },
  get skeleton() {
    const bones = scene.shownBones;
    return bones && { nodes: bones.now.length / 3, segments: bones.segments.length / 2, places: scene.nodePlaces() };
  },
  picture: () => scene.picture(),
  featureBounds: (name) => scene.featureBounds(name),
  featurePlace: (name) => scene.featurePlace(name),
});

refresh();
connection.start();
