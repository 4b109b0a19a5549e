/**
 * `window.tombolo`: what the viewer knows, for tests and for the curious. It can be read and not written, and every value is
 * a copy; the numbers of `views` and `featureBounds` are those of the newest frame.
 */
import type { ConnectionState } from "./connection/connection";
import type { Person, PinnedNote, QualitySummary, Role, RunEnd, Status, Vector } from "./connection/protocol";
import type { Stand } from "./picture/camera";
import type { Handles } from "./handles/handles";
import { own } from "./own";
import type { Picture, Scene } from "./picture/scene";
import type { SliceHandle } from "./picture/slice-handle";
import type { Action } from "./store/actions";
import { chosen } from "./store/draft";
import type { OrderRecord, PreviewState, State } from "./store/state";
import type { Store } from "./store/store";

export interface ViewInspection { bounds: [Vector, Vector] | null; points: number; triangles: number; topology: string | null; /** Of the newest frame; null before the first. */ cycle: number | null }

export interface PreviewInspection extends PreviewState { bounds: [Vector, Vector] | null }

export interface ForecastInspection {
  state: "none" | "waiting" | "told" | "failed";
  outcome: "applied" | "clamped" | "rejected" | null;
  min: number | null;
  inverted: number | null;
  fraction: number | null;
  reason: string | null;
}

export interface Inspection {
  /** How the connection stands: connecting, connected, reconnecting, refused or ended. */
  readonly connection: ConnectionState;
  readonly role: Role | null;
  /** The name of this viewer in the run; null before it has one. */
  readonly client: string | null;
  /** The cycle of the newest frame; null before the first. */
  readonly cycle: number | null;
  /** Data frames taken since the page was opened. */
  readonly frames: number;
  readonly views: Readonly<Record<string, ViewInspection>>;
  /** Orders by the time they became known, with their state and reason. */
  readonly orders: readonly OrderRecord[];
  readonly status: Status | null;
  readonly quality: QualitySummary | null;
  readonly stack: readonly unknown[];
  /** The pipelines of the run, as JSON. */
  readonly pipelines: readonly unknown[];
  /** Who is connected. */
  readonly people: readonly Person[];
  /** The notes that are pinned. */
  readonly notes: readonly PinnedNote[];
  /** Whether the camera of the one who steers is followed, and where the camera is. */
  readonly following: boolean;
  readonly camera: Stand;
  /** The last word of a run that has ended. */
  readonly end: RunEnd | null;
  /** Handle and fixed features, by name. */
  readonly selection: { handle: string[]; fixed: string[] };
  /** The preview that is drawn, or why there is none. */
  readonly preview: PreviewInspection;
  /** What the order in the form would come to, as the simulation told it. */
  readonly forecast: ForecastInspection;
  /** The skeleton that is drawn, with the places of the page of the nodes that can be dragged; null when there is none. */
  readonly skeleton: { nodes: number; segments: number; places: [number, number][] } | null;
  /** Places of the page at which the parts of the gizmo can be gripped, such as `arrow z`; none when there is no handle. */
  readonly gizmo: Readonly<Record<string, [number, number]>>;
  /** A place of the page at which the slice of the chosen view can be gripped; null where it cannot. */
  readonly sliceHandle: [number, number] | null;
  /** What went wrong, newest last: frames or messages that could not be read, and what has failed in the page. */
  readonly errors: readonly string[];
  /** The box around a feature as it is now; null when no view shows it. */
  featureBounds(name: string): [Vector, Vector] | null;
  /** Draws all that has come, and says what was drawn. */
  picture(): Promise<Picture>;
  /** A place of the page (clientX, clientY) at which a click would pick this feature; null when it cannot be seen. */
  featurePlace(name: string): [number, number] | null;
}

declare global {
  interface Window { tombolo?: Inspection }
}

/** What the store knows, and what is drawn. */
export function inspectionOf(
  store: Pick<Store<State, Action>, "state">, scene: Scene, handles: Pick<Handles, "nodePlaces" | "places" | "isFree">, sliceHandle: Pick<SliceHandle, "place">,
): Inspection {
  return {
    get connection() { return store.state.connection.state; },
    get role() { return store.state.hello?.role ?? null; },
    get client() { return store.state.hello ? String(store.state.hello.client) : null; },
    get cycle() { return store.state.frames.cycle; },
    get frames() { return store.state.frames.count; },
    get views() {
      return Object.fromEntries([...scene.layers].map(([name, layer]) => [name, {
        bounds: scene.viewBounds(name), points: layer.topology?.points ?? 0,
        triangles: (layer.topology?.triangles.length ?? 0) / 3, topology: layer.topology?.topology ?? null,
        cycle: own(store.state.frames.views, name)?.cycle ?? null,
      }]));
    },
    get orders() { return structuredClone(store.state.orders); },
    get status() { return structuredClone(store.state.status); },
    get quality() { return structuredClone(store.state.status?.quality ?? null); },
    get stack() { return structuredClone(store.state.hello?.stack ?? []); },
    get selection() { return { handle: chosen(store.state, "handle"), fixed: chosen(store.state, "fixed") }; },
    get preview() { return { ...structuredClone(store.state.preview), bounds: scene.previewBounds }; },
    get forecast() {
      const { state, answer, reason } = store.state.forecast;
      return {
        state, reason, outcome: answer?.outcome ?? null, min: answer?.quality?.min ?? answer?.min_scaled_jacobian ?? null,
        inverted: answer?.quality?.inverted ?? null, fraction: answer?.fraction ?? null,
      };
    },
    get pipelines() { return structuredClone(store.state.pipelines.known); },
    get people() { return structuredClone(store.state.people); },
    get notes() { return structuredClone(store.state.notes); },
    get following() { return store.state.following; },
    get camera() { return scene.camera.stand; },
    get end() { return structuredClone(store.state.end); },
    get errors() { return [...store.state.errors]; },
    get skeleton() {
      const bones = scene.shownBones;
      return bones && { nodes: bones.now.length / 3, segments: bones.segments.length / 2, places: handles.nodePlaces() };
    },
    get gizmo() { return handles.places(); },
    get sliceHandle() { return sliceHandle.place; },
    picture: () => scene.picture(),
    featureBounds: (name) => scene.featureBounds(name),
    featurePlace: (name) => scene.places.featurePlace(name, (x, y) => handles.isFree(x, y)),
  };
}

/** Publishes the getters of `source` on `window.tombolo`. */
export function publish(source: Inspection): void {
  Object.defineProperty(window, "tombolo", { value: Object.freeze(source), writable: false, configurable: false });
}
