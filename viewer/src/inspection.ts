/**
 * `window.tombolo`: what the viewer knows, for tests and for the curious. It can be read and not written, and every value is
 * a copy; the numbers of `views` and `featureBounds` are those of the newest frame.
 */
import type { ConnectionState } from "./connection/connection";
import type { Person, PinnedNote, QualitySummary, Role, RunEnd, Status, Vector } from "./connection/protocol";
import type { Stand } from "./picture/camera";
import type { Picture } from "./picture/scene";
import type { OrderRecord, PreviewState } from "./store/state";

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

/** Publishes the getters of `source` on `window.tombolo`. */
export function publish(source: Inspection): void {
  Object.defineProperty(window, "tombolo", { value: Object.freeze(source), writable: false, configurable: false });
}
