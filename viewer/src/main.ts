/** Puts the parts together: what arrives becomes an action, what is asked a message, and every panel shows the store. */
import { keepIdentity } from "./connection/identity";
import { loadJson } from "./connection/json";
import { Pipelines } from "./connection/pipelines";
import type { Frame, Monitor, ServerMessage, ToldHello, Vector } from "./connection/protocol";
import { SentViews } from "./connection/sent-views";
import { Stack } from "./connection/stack";
import { watchDefects } from "./defects";
import { part, write } from "./dom";
import { EditForm } from "./form/form";
import { SchemaLoader } from "./form/loader";
import { Handles } from "./handles/handles";
import { FaceTools } from "./handles/face-tools";
import { Overlay } from "./handles/overlay";
import { ShapeTarget } from "./handles/shape-target";
import { inspectionOf, publish } from "./inspection";
import { History, seriesKey } from "./history/series";
import { Dock } from "./history/dock";
import { HistogramPlot } from "./history/histogram-plot";
import { LinePlot } from "./history/line-plot";
import { MESH, SMALLEST, isMonitored, takeQuality } from "./history/mesh-quality";
import { HistoryPlot } from "./history/plot";
import { Later } from "./later";
import { pointed } from "./number";
import { own } from "./own";
import { ClickTools, OnePlace, middleOf } from "./panels/click-tools";
import type { ClickTool } from "./panels/click-tools";
import { watchEmpty } from "./panels/empty";
import { EditsPanel } from "./panels/edits";
import { watchKeys } from "./panels/keys";
import { FIELD_TITLES, LookPanel } from "./panels/look";
import { FilesPanel } from "./panels/files";
import { Notice } from "./panels/notice";
import { NotesPanel } from "./panels/notes";
import { PeoplePanel } from "./panels/people";
import { MonitorPanel } from "./panels/monitors";
import { PipelineEditorPanel } from "./panels/pipeline-editor";
import { PipelinesPanel } from "./panels/pipelines";
import { ParameterPanel } from "./panels/parameters";
import { RecordingPanel } from "./panels/recording";
import { StatusBar } from "./panels/status";
import { VerdictPanel } from "./panels/verdict";
import { watchDrawers } from "./panels/drawers";
import { WorstCells } from "./panels/quality";
import { QualityHistogram } from "./panels/quality-histogram";
import { SlicePanel } from "./panels/slice";
import { watchSurfaceTools } from "./panels/surface-tools";
import { Tour } from "./panels/tour";
import { CameraTools, Theming, watchPictureTools } from "./panels/tools";
import { ViewList } from "./panels/views";
import { WheelPanel } from "./panels/wheel";
import { makeCanvas } from "./picture/canvas";
import type { Canvas } from "./picture/canvas";
import { ScalarBars, fieldText, withUnit } from "./picture/bars";
import { Triad, coveredBy, leaveRoomFor, showEmpty } from "./picture/overlay";
import { Marks } from "./picture/marks";
import { Pins } from "./picture/pins";
import { watchPointer } from "./picture/pointer";
import { readingText } from "./picture/probe";
import { Compare } from "./picture/compare";
import { Following } from "./picture/following";
import { Earlier } from "./picture/earlier";
import type { Content } from "./picture/earlier";
import { Movie } from "./picture/movie";
import { SliceHandle } from "./picture/slice-handle";
import { withTyped } from "./picture/ranges";
import { Ruler } from "./picture/ruler";
import { paint, save, withBars } from "./picture/screenshot";
import { Scene } from "./picture/scene";
import type { Bar } from "./picture/scene";
import { Checker } from "./pipelines/checker";
import { Forecasts } from "./preview/forecasts";
import { Previewer } from "./preview/previewer";
import { Memory } from "./remember";
import type { Action } from "./store/actions";
import { Commands } from "./store/commands";
import { appliedOrders, isShapeUnderWay } from "./store/orders";
import { fieldNamed, fieldsOf, sameFields } from "./store/fields";
import { Kept, KeptRun } from "./store/kept";
import { onlyLook } from "./store/looks";
import type { Look } from "./store/looks";
import { NO_PIPELINES, readDrafts } from "./store/pipeline-drafts";
import { LINE, WORST, withQuality } from "./store/pipelines";
import { reduce } from "./store/reduce";
import { Selection } from "./store/selection";
import { writeForRun } from "./store/session";
import { INITIAL } from "./store/state";
import type { State } from "./store/state";
import { Store, sameJson } from "./store/store";
import { addresses, kernel, stream } from "./start";

const { connection } = stream;

const kept = new Kept(window.localStorage, location.pathname);
const keptRun = new KeptRun(sessionStorage, location.pathname);
/** Pipelines that are being written are kept over a reload of this page, and no longer. */
const DRAFTS = `tombolo-drafts ${location.pathname}`;
const store = new Store<State, Action>({ ...INITIAL, looks: kept.looks, pipelines: { ...NO_PIPELINES, drafts: readDrafts(sessionStorage.getItem(DRAFTS)) } }, reduce);
store.watch((state) => state.pipelines.drafts, (drafts) => void writeForRun(sessionStorage, location.pathname, { [DRAFTS]: JSON.stringify(drafts) }));
/** The first picture comes before all that can wait. */
const later = new Later(1500);
const report = (text: string): void => store.dispatch({ type: "unreadable", text });
// One that comes of its own notice is told once.
watchDefects(window, (text) => { if (text !== store.state.errors.at(-1)) report(text); });

const stack = new Stack(addresses.stack, {
  awaited: () => store.dispatch({ type: "stack awaited", undoable: stack.told.undoable }),
  changed: () => store.dispatch({ type: "stack", edits: stack.edits, undoable: stack.told.undoable }),
  trouble: report,
});
const commands = new Commands(store, (message) => connection.send(message));
const pipelines = new Pipelines(() => loadJson(addresses.pipelines), (message) => commands.send(message), (reason) => report(`the pipelines: ${reason}`));
store.watch((state) => [state.connection.state, state.hello?.pipelines?.changes] as const, ([state, changes]) => {
  if (state !== "connected") pipelines.forget();
  else if (changes !== undefined) later.run(() => {
    if (store.state.connection.state === "connected") void pipelines.told(store.state.hello?.pipelines?.changes ?? changes);
  });
}, sameJson);

// `?view=NAME` shows that view alone, without panels: for a page of one's own.
const onlyView = new URLSearchParams(window.location.search).get("view");
document.body.dataset.embedded = String(onlyView !== null);

// The picture.
function canvasOfPage(): Canvas {
  try {
    return makeCanvas();
  } catch (error) {
    connection.stop();
    // Nothing of the page is there yet but its words.
    document.body.dataset.embedded = "true";
    showEmpty("This browser cannot draw the picture", "It has no WebGL 2, or it is switched off. Any current Chrome, Firefox, Edge or Safari has it.");
    throw error;
  }
}
const selection = new Selection(store);
const triad = new Triad();
/** A field and its component in words, as a view carries it. */
const fieldTitle = (field: string | null, component: number, view: string | null = null): string =>
  fieldText(field ?? "", fieldNamed(store.state, field, view)?.components ?? 1, component, own(FIELD_TITLES, field ?? ""));
/** The unit of a field; null where none is given. */
const unitOf = (field: string | null): string | null => fieldNamed(store.state, field)?.unit ?? null;
/** A field and its component in words, with its unit. */
const titleWithUnit = (field: string | null, component: number): string => withUnit(fieldTitle(field, component), unitOf(field));
const bars = new ScalarBars(part("bars"), ({ look: { field, component }, views }) => ({ title: fieldTitle(field, component, views[0]), unit: unitOf(field) }), (names, range) => {
  for (const view of names) {
    const look = own(store.state.looks, view);
    if (look) store.dispatch({ type: "look", view, look: { range: withTyped(look.range, range) } });
  }
});
const scene = new Scene(part("scene"), canvasOfPage(), selection, {
  bars: (shown) => {
    bars.show(shown);
    look.setBars(shown);
    compare.setBars(shown);
  },
  drawn: (axes) => {
    triad.turn(axes);
    movie.drawn();
    following.drawn();
    if (pins.update()) history.update();
    worst.update();
    marks.draw();
    slice.drawn();
    sliceHandle.drawn();
    handles.drawn();
    compare.follow();
    linePlot.update();
    histogramPlot.update();
    if (store.state.frames.count > 0) later.begin();
  },
  trouble: report,
  covered: () => coveredBy(part("scene"), part("tools"), part("bars")),
  lost: (isLost) => store.dispatch({ type: "picture lost", isLost }),
});
// The bars of a view may come after the first picture, and go.
new ResizeObserver(() => {
  leaveRoomFor(part("bars"), part("pictures"));
  scene.camera.refit();
}).observe(part("bars"));
const marks = new Marks(document.querySelector<SVGElement>("#marks")!, (point) => scene.places.onPage(point));
const ruler = new Ruler(marks);
const line = new Ruler(marks, "line", (from, to) => {
  linePlot.take(from, to);
  dock.choose(linePlot);
});
/** Takes what lies at a place of the page into a plot; returns whether that is the model. */
function pinAt(x: number, y: number): boolean {
  const probe = scene.places.probe(x, y);
  if (probe) pins.add(probe);
  return probe !== null;
}
/** A tool that takes places of the model. */
const placing = (button: string, isOn: () => boolean, toggle: () => void, take: (place: Vector) => void): ClickTool => ({
  button, isOn, toggle, take: (x, y) => {
    const place = placeAt(x, y);
    if (place) take(place);
    return place !== null;
  },
});
const clickTools = new ClickTools(part("scene"), [
  ...([["ruler", ruler], ["line", line]] as const).map(([button, tool]) => placing(button, () => tool.active, () => tool.toggle(), (place) => tool.take(place))),
  placing("note", () => notes.choosing, () => notes.toggle(), (place) => notes.take(place)),
  new OnePlace("pin", pinAt),
]);
const overlay = new Overlay(part("stage"), part("scene").nextElementSibling);
const faces = new FaceTools(part("stage"), part("scene"), overlay.root, part("faces"), {
  projection: () => scene.places.projection(), setChosenFaces: (points, corners) => scene.setChosenFaces(points, corners),
}, store, (listener) => previewer.watchSurface(listener), () => scene.redraw());
const handles = new Handles(part("stage"), part("scene"), {
  projection: () => scene.places.projection(), pick: (x, y) => scene.places.pick(x, y), get shownBones() { return scene.shownBones; },
}, store, selection, new ShapeTarget(() => store.state, () => scene.shown(), faces), overlay, part("tools"), () => clickTools.current !== null);
/** The place of the model under a place of the page, in numbers that a person would write down. */
function placeAt(x: number, y: number): Vector | null {
  const probe = scene.places.probe(x, y);
  const reading = probe && scene.places.read(probe);
  const [low, high] = scene.bounds() ?? [[0, 0, 0], [0, 0, 0]];
  return reading && pointed(reading.point, Math.hypot(...low.map((from, k) => high[k]! - from)));
}
watchPointer(part("scene"), scene.places, selection, {
  reading: (x, y) => {
    const probe = scene.places.probe(x, y);
    const reading = probe && scene.places.read(probe);
    return reading ? readingText(reading, fieldTitle(reading.field, reading.component), unitOf(reading.field)) : "";
  },
  tool: () => clickTools.taking(),
});

// What stands around it.
new ViewList(part("views"), store);
const look = new LookPanel(part("look"), store, (view) => {
  const pipeline = pipelines.get(view);
  if (pipeline) pipelines.set(withQuality(pipeline));
});
const slice = new SlicePanel(part("slice"), store, pipelines, () => scene.bounds());
const sliceHandle = new SliceHandle(document.querySelector<SVGElement>("#cut")!, part("scene"), {
  projection: () => scene.places.projection(), bounds: () => scene.bounds(), redraw: () => scene.redraw(),
  points: () => scene.layers.get(store.state.chosenView ?? "")?.coordinates ?? new Float32Array(0),
}, slice);
const earlier: Earlier = new Earlier(store, () => [...scene.layers.values()].filter(({ name }) => sentViews.has(name)), () => {
  compare.update();
  linePlot.update();
  histogramPlot.update();
});
const compare = new Compare(part("before"), part("compare"), scene, earlier, {
  views: () => store.state.hello?.views ?? [], looks: () => store.state.looks, features: () => store.state.hello?.features ?? [], selection, trouble: report,
  shown: (isShown) => { part("now").hidden = !isShown; },
});
const following = new Following(store, commands, scene.camera, () => cameraTools.show());
const worst = new WorstCells(part("quality"), store, pipelines, scene, marks);
const cameraTools = new CameraTools(part("tools"), scene);
const reveal = watchDrawers();
const notes: NotesPanel = new NotesPanel(store, commands, marks, {
  flyTo: (place) => scene.camera.flyTo(place),
  middle: () => placeAt(...middleOf(part("scene"))) ?? scene.camera.stand.focalPoint,
}, reveal);
/** What a view holds now. */
function contentOf(view: string): Content | null {
  const layer = scene.layers.get(view);
  return layer?.topology && layer.frame ? { topology: layer.topology, frame: layer.frame } : null;
}
const monitored = new History();
const history = new HistoryPlot(monitored, kept.dock.chosen, (chosen) => { kept.dock = { ...kept.dock, chosen }; });
const lookOf = (view: string | null): Look | null => (view === null ? null : own(store.state.looks, view) ?? null);
const linePlot = new LinePlot(store, pipelines, {
  frame: () => scene.layers.get(LINE)?.frame ?? null, look: () => lookOf(store.state.chosenView), title: ({ field, component }) => titleWithUnit(field, component),
}, earlier, () => dock.update());
const histogramPlot = new HistogramPlot(store, {
  content: contentOf, title: ({ field, component }) => titleWithUnit(field, component),
}, earlier);
const dock = new Dock(part("dock"), kept.dock.open, (open) => { kept.dock = { ...kept.dock, open }; }, (work) => later.run(work));
for (const tab of [history, linePlot, histogramPlot]) dock.add(tab);
new Theming(part("theme") as HTMLButtonElement, kept, (theme) => {
  scene.setTheme(theme);
  compare.setTheme(theme);
  dock.recolour();
});
store.watch((state) => state.frames.count > 0, () => dock.update());
const barTitle = ({ look: { field, component } }: Bar): string => titleWithUnit(field, component);
const ink = (): string => getComputedStyle(document.body).color;
const ground = (): string => getComputedStyle(document.body).getPropertyValue("--over").trim();
const movie = new Movie(() => scene.element, (context, picture) => paint(context, picture, bars.all, barTitle, ink(), ground()), {
  name: () => `tombolo-${store.state.frames.cycle ?? 0}`,
  told: (isRunning) => {
    scene.isFilmed = isRunning;
    part("movie").setAttribute("aria-pressed", String(isRunning));
    write(part("movie"), isRunning ? "End film" : "Film");
    // So that it begins with what is seen, also where nothing changes.
    if (isRunning) scene.redraw();
  },
  trouble: report,
});
const pins: Pins = new Pins(monitored, marks, scene.places, ({ field, component }) => ({ name: fieldTitle(field, component), unit: unitOf(field) }), (key, isNew) => {
  history.choose(key);
  if (isNew) dock.choose(history);
}, () => sentViews.update());
const sentViews: SentViews = new SentViews(store, () => pins.views, onlyView, (message) => commands.ask(message));
watchPictureTools(part("scene"), part("stage"), {
  pin: pinAt,
  unpin: () => pins.clear(),
  use: (button) => clickTools.use(button),
  movie: () => movie.toggle(),
  save: () => scene.withPicture((canvas) => save(withBars(canvas, bars.all, barTitle, ink(), ground()), `tombolo-${store.state.frames.cycle ?? 0}.png`)),
});
const monitors = new MonitorPanel(part("monitors"));
const parameters = new ParameterPanel(part("parameters"), store, commands);
pipelines.onChange(() => store.dispatch({ type: "pipelines known", pipelines: pipelines.all }));
new PipelinesPanel(store, commands, () => scene.bounds());
new PipelineEditorPanel(store, commands, {
  schema: () => loadJson(addresses.pipelineSchema), load: () => import("./pipelines/editor"),
  checker: new Checker(() => new Worker(new URL("./pipelines/check.worker.ts", import.meta.url), { type: "module" })),
}, reveal);
const bar = new StatusBar(store, commands);
const wheel = new WheelPanel(store, commands);
const people = new PeoplePanel(store, commands, kept, () => window.location.href);
new RecordingPanel(store, commands);
new EditsPanel(store, commands);
const form = new EditForm(part("fields"), store);
const previewer = new Previewer(scene, addresses.surface, kernel, store);
// Once the page has come to rest: nobody drags a shape in the first moment.
later.run(() => window.setTimeout(() => previewer.prepare(), 500));
new FilesPanel(store, commands, { surface: () => previewer.surfaceNow(), content: contentOf });
const forecasts = new Forecasts(store, {
  ask: (order) => commands.ask({ forecast: order }),
  withdraw: () => void commands.ask({ withdraw_forecast: {} }),
});
new QualityHistogram(store);
new VerdictPanel(store, commands, (place) => scene.camera.flyTo(place), () => form.focusProblem());
watchKeys(store, commands);
new Tour(() => {
  kept.toured = true;
  part("tour-button").classList.remove("primary");
}, reveal);
part("tour-button").classList.toggle("primary", !kept.toured);

function takeMessage(message: ServerMessage): void {
  // The bar looks itself whether there is news in a status.
  if (message.kind !== "status") bar.alive();
  switch (message.kind) {
    case "hello": return takeHello(message.body);
    case "status":
      if (store.state.hello?.monitors && takeQuality(monitored, store.state.hello.monitors, message.body, store.state.pipelines.known)) {
        history.update();
        dock.update();
      }
      return store.dispatch({ type: "status", status: message.body, at: performance.now() });
    case "order": return store.dispatch({ type: "order", status: message.body });
    case "parameters": return store.dispatch({ type: "parameters", values: message.body.values });
    case "stack": return stack.change(message.body);
    case "precision": return store.dispatch({ type: "precision", ...message.body });
    case "forecast": return forecasts.answer(message.body);
    case "monitor": return takeMonitor(message.body);
    // The hello that comes with it says what there is now.
    case "pipelines":
      if (message.body.status === "applied") pipelines.answered(message.body.id);
      return store.dispatch({ type: "pipelines outcome", change: message.body });
    // The status shows what it has changed.
    case "done": return parameters.done(message.body.id);
    case "play": return store.dispatch({ type: "played", played: message.body });
    case "wheel": return store.dispatch({ type: "wheel asked", by: message.body.asked_by });
    case "kept": return wheel.kept(message.body);
    case "link": return void people.take(message.body);
    case "people": return store.dispatch({ type: "people", viewers: message.body.viewers });
    case "followed": return following.followed(message.body.by);
    case "camera": return following.take(message.body);
    case "note": return store.dispatch({ type: "note pinned", note: message.body });
    case "note_removed": return store.dispatch({ type: "note removed", number: message.body.number });
    case "end":
      // There is nothing to come back to.
      connection.stop();
      return store.dispatch({ type: "end", end: message.body });
    case "error": {
      const { id, message: text } = message.body;
      const changed = pipelines.changedBy(id);
      if (pipelines.answered(id)) void pipelines.reload();
      if (changed === WORST) worst.refused();
      if (id && id === store.state.pipelines.asked?.id) return store.dispatch({ type: "pipelines refused", id, text });
      if (id && (forecasts.refused(id, text) || parameters.refused(id, text) || people.refused(id, text) || wheel.told(id, text) || notes.refused(id, text))) return;
      store.dispatch({ type: "refused", id: id ?? null, text });
    }
  }
}

function takeMonitor(monitor: Monitor): void {
  // What the page has counted for itself is nothing to plot.
  if (monitor.pipeline === WORST) return worst.take(monitor.values);
  monitors.update(monitor);
  monitored.add(monitor.pipeline, monitor.cycle, monitor.time ?? monitor.cycle, monitor.values);
  for (const { pipeline, name, unit } of store.state.hello?.monitors ?? []) monitored.setUnit(pipeline, name, unit ?? null);
  history.update();
  dock.update();
}

function takeHello({ stack: told, ...hello }: ToldHello): void {
  // Until the edits of a new connection are here, those of before are shown.
  if (told) stack.begin(told);
  store.dispatch({ type: "hello", hello: { ...hello, stack: stack.edits, isAwaitingEdits: !stack.isWhole, undoable: stack.told.undoable } });
}

function takeFrame(frame: Frame): void {
  if (frame.kind === "topology") return scene.setTopology(frame);
  const fields = fieldsOf(frame);
  if (!sameFields(own(store.state.carried, frame.view), fields)) store.dispatch({ type: "carries", view: frame.view, fields });
  if (scene.setData(frame)) store.dispatch({ type: "frame", view: frame.view, cycle: frame.cycle });
}

const memory = new Memory(store, keptRun, {
  isEmbedded: onlyView !== null, camera: scene.camera, compare, pins, worst, monitored,
  restored: () => {
    cameraTools.show();
    history.update();
    dock.update();
  },
  whenDrawn: (then) => store.watch((state) => state.frames.count > 0, (isThere) => { if (isThere) void scene.picture().then(then); }),
});

const schemaLoader = new SchemaLoader(store, () => loadJson(addresses.schema));
store.watch((state) => state.hello, (hello) => {
  if (!hello) return;
  memory.greeted(hello);
  connection.identity = { client: String(hello.client), back: hello.back ?? "" };
  keepIdentity(connection.identity);
  scene.setFeatures(hello.features.map((feature) => feature.name));
  if (hello.monitors) {
    const shown = hello.monitors.filter(({ pipeline }) => pipeline !== WORST);
    monitors.keep(shown);
    monitored.keep([...shown.map(({ pipeline, name }) => seriesKey(pipeline, name)), ...(isMonitored(shown, store.state.pipelines.known) ? [] : [seriesKey(MESH, SMALLEST)])]);
  }
  if (!store.state.form) later.run(() => void schemaLoader.want(hello));
});

new Notice(store);
store.watch((state) => state.draft.updating, (updating) => write(part("edit-title"), updating === null ? "New edit" : `Edit ${updating + 1}`));

watchEmpty(store, onlyView);
part("retry").addEventListener("click", () => connection.retry());
window.addEventListener("online", () => { if (connection.state !== "dismissed" && !store.state.end) connection.retry(); });

store.watch((state) => ({ views: state.hello?.views ?? [], looks: state.looks, held: isShapeUnderWay(state.orders) }),
  ({ views, looks, held }) => scene.setLooks(views, onlyView === null ? looks : onlyLook(looks, onlyView), held),
  (a, b) => a.held === b.held && sameJson(a.looks, b.looks) && sameJson(a.views, b.views));
store.watch((state) => state.looks, (looks) => {
  kept.looks = looks;
  compare.update();
});
store.watch(appliedOrders, (marks) => history.setMarks(marks));

watchSurfaceTools(store, previewer, report);

publish(inspectionOf(store, scene, handles, sliceHandle));

stream.listen({
  state: (state, explanation) => store.dispatch({ type: "connection", state, explanation }),
  message: takeMessage,
  alive: () => bar.alive(),
  frame: takeFrame,
  trouble: report,
});
