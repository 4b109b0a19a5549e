/** The messages of the stream: JSON in both directions, and what the binary frames hold once the kernel has decoded them. */
export const PROTOCOL_VERSION = 2;

export type Vector = [number, number, number];
export type Association = "vertex" | "element";
export type Json = null | boolean | number | string | Json[] | { [key: string]: Json };
export type Role = "driver" | "watcher";

export interface ViewInformation { name: string; kind: string }
/** What a feature is to the solver; null where it has not said. */
export type Condition = "inflow" | "outflow" | "wall";
export interface FeatureInformation { name: string; faces: number; vertices: number; bounds: [Vector, Vector]; condition?: Condition | null }
export interface FieldInformation { name: string; association: Association; components: number; unit?: string | null }
export interface ParameterInformation { name: string; value: number; minimum?: number | null; maximum?: number | null; unit?: string | null }

/** The surface from which shapes are measured; its points are sent on request only. */
export interface SurfaceInformation { id: string; vertices: number; faces: number }

/** A moment of a recording. */
export interface RecordedMoment { seconds: number; cycle: number; time: number }

/** How many edits make the shape, of which the first `kept` are those of before, and how many orders can be taken back. */
export interface StackInformation { revision: number; edits: number; kept?: number; undoable?: number }

/** How exact a view is: its values are within so many times the bound that was asked for, 1 where the link carries it as it is. */
export interface Precision { view: string; coarser: number }

/** A viewer that is connected, the name that it has given itself, and whether it could steer. Two may have the same name. */
export interface Person { client: string; name: string | null; role: Role; may_drive: boolean }

/** A note that is pinned to a place of the mesh and a cycle. */
export interface PinnedNote { number: number; text: string; at: Vector; cycle: number; by: string }

/** The rights of the browser that a link opens. */
export type LinkFor = "watch" | "drive";
/** A link that opens one browser, once; `path` is relative to the page. */
export interface LinkTold { for: LinkFor; path: string; id?: string | null }

/** The camera of the one that drives. */
export interface ToldCamera { position: Vector; focal_point: Vector; view_up: Vector; parallel: boolean; parallel_scale: number; view_angle: number }

export interface Hello {
  protocol: number;
  client: string | number;
  /** What this viewer shows to come back under its name. */
  back?: string;
  role: Role;
  /** False for one that came with the secret for watching. */
  may_drive?: boolean;
  channel?: string | null;
  views: ViewInformation[];
  monitors?: MonitorInformation[];
  /** How often the pipelines have changed. */
  pipelines?: { changes: number };
  features: FeatureInformation[];
  surface?: SurfaceInformation | null;
  fields: FieldInformation[];
  parameters: ParameterInformation[];
  stack: Json[];
  /** Whether the run's stack is another one, whose edits are being fetched. */
  isAwaitingEdits?: boolean;
  /** How many orders can be taken back. */
  undoable?: number | undefined;
  orders: OrderStatus[];
  defaults: { deform?: Json; guard?: Json; schedule?: Json };
  /** The notes, the oldest first: in the first of a connection, and in each of a recording. */
  notes?: PinnedNote[];
  /** What is shown is no run but a recording of one, from its first moment to its last. */
  recording?: { first: RecordedMoment; last: RecordedMoment; lost_bytes?: number } | null;
}

/** The message of the server: the edits themselves are fetched. `stack` is in the first of a connection. */
export type ToldHello = Omit<Hello, "stack" | "isAwaitingEdits" | "undoable"> & { stack?: StackInformation };

export interface QualitySummary {
  min: number;
  mean?: number;
  inverted?: number;
  /** How many cells have a scaled Jacobian in each of equal classes from -1 to 1. */
  histogram?: number[];
}

/** What a pipeline has cost so far; it runs at one in `every` of its times. */
export interface PipelineCost { name: string; runs: number; seconds: number; bytes: number; memory: number; every: number }

export interface Status {
  cycle: number;
  time: number;
  paused: boolean;
  stopped: boolean;
  step_seconds?: number | null;
  viewers?: number;
  driver?: string | number | null;
  quality?: QualitySummary | null;
  pipelines?: PipelineCost[];
  /** Why the journal cannot be written; while it cannot, no order is taken. */
  journal_lost?: string | null;
}

export type OrderState = "accepted" | "computing" | "applying" | "applied" | "rejected";

export interface OrderStatus {
  id: string;
  status: OrderState;
  /** What was asked for; told when it comes in, and in `hello`. */
  order?: Json;
  reason?: string | null;
  cycle_applied?: number | null;
  shape?: number | null;
  shapes?: number | null;
  min_scaled_jacobian?: number | null;
  /** What the guard judged; the surface alone where the solver moves its volume by itself. */
  judged?: "volume" | "surface" | null;
  /** The first shape that the solver did not move its mesh to. */
  not_followed?: { cycle: number; shape: number; distance: number } | null;
  deviation?: number | null;
  largest_displacement?: number | null;
  /** The part of its amounts that is done, or of a rejected order the part that would have passed. */
  fraction?: number | null;
  seconds?: { surface?: number; volume?: number; guard?: number } | null;
  added_steps?: number | null;
}

/** What an order would come to, for the viewer that asked. */
export interface ForecastAnswer {
  id?: string | null;
  order: {
    outcome: "applied" | "clamped" | "rejected";
    reason?: string | null;
    fraction?: number | null;
    min_scaled_jacobian?: number | null;
    judged?: "volume" | "surface" | null;
    largest_displacement?: number | null;
    shapes?: number | null;
    sub_steps?: number | null;
    /** Where it would fail: the worst cell, or the first face that is broken. */
    place?: Vector | null;
    quality?: QualitySummary | null;
    /** That of the mesh where it would begin. */
    quality_before?: QualitySummary | null;
    seconds?: { surface?: number; volume?: number; guard?: number } | null;
  };
}

export interface Monitor { pipeline: string; cycle: number; time?: number; values: Record<string, number | null> }
export interface MonitorInformation { pipeline: string; name: string; unit?: string | null }
/** What became of a change of the pipelines. */
export interface PipelineChange {
  id: string;
  status: "accepted" | "applied";
  cycle?: number;
  added?: string[];
  replaced?: string[];
  removed?: string[];
}

/** A command that is no order has taken effect. */
export interface Done { id: string; cycle: number; time: number }

export interface ServerError { message: string; id?: string | null }

/** Another viewer asks the one that drives for the wheel. */
export interface WheelAsked { asked_by: string; name?: string | null }

/** The one that drives keeps the wheel that this viewer asked for. */
export interface WheelKept { by: string; name?: string | null }

/** Where in a recording the viewer is. */
export interface Played extends RecordedMoment { speed: number; paused: boolean; at_end: boolean }

/** The last word of a run. */
export interface RunEnd { how: "finished" | "stopped" | "failed"; cycle: number; time: number }

export type ServerMessage =
  | { kind: "hello"; body: ToldHello }
  | { kind: "status"; body: Status }
  | { kind: "order"; body: OrderStatus }
  | { kind: "parameters"; body: { values: Record<string, number> } }
  | { kind: "stack"; body: StackInformation }
  | { kind: "precision"; body: Precision }
  | { kind: "forecast"; body: ForecastAnswer }
  | { kind: "monitor"; body: Monitor }
  | { kind: "pipelines"; body: PipelineChange }
  | { kind: "done"; body: Done }
  | { kind: "wheel"; body: WheelAsked }
  | { kind: "kept"; body: WheelKept }
  | { kind: "link"; body: LinkTold }
  | { kind: "people"; body: { viewers: Person[] } }
  | { kind: "followed"; body: { by: number } }
  | { kind: "camera"; body: ToldCamera }
  | { kind: "note"; body: PinnedNote }
  | { kind: "note_removed"; body: { number: number } }
  | { kind: "play"; body: Played }
  | { kind: "end"; body: RunEnd }
  | { kind: "error"; body: ServerError };

export type ClientMessage = { id?: string } & (
  | { order: Json } | { forecast: Json } | { withdraw_forecast: object } | { pause: object } | { resume: object } | { stop: object }
  | { parameter: { name: string; value: number } } | { pipelines: Json } | { cancel: { order: string } } | { drive: object }
  | { play: { seek?: { seconds: number } | { cycle: number }; speed?: number; paused?: boolean } }
  | { hand_over: { to: string } } | { keep: object } | { kick: { client: string } } | { here: object }
  | { link: { for: LinkFor } } | { name: { name: string } } | { follow: { on: boolean } } | { camera: ToldCamera }
  | { note: { text: string; at: Vector; cycle?: number } } | { remove_note: { number: number } }
  | { views: { names?: string[] } }
);

/** Raised for a message that does not follow the protocol; the text says where it departs from it. */
export class ProtocolError extends Error {
  constructor(message: string) {
    super(message);
    this.name = "ProtocolError";
  }
}

/** Raised for a server of another version: nothing that it says can be read. */
export class VersionError extends ProtocolError {
  constructor(readonly found: Json | undefined) {
    super(`the simulation speaks protocol ${JSON.stringify(found) ?? "unknown"}, this page ${PROTOCOL_VERSION}`);
  }
}

/** The shape of one view: what connects its points. `triangleFeatures` numbers the features of `hello`. */
export interface TopologyFrame {
  kind: "topology";
  view: string;
  topology: string;
  points: number;
  triangles: Uint32Array;
  triangleFeatures: Uint32Array | null;
  lines: Uint32Array;
}

/** One array of a data frame, interleaved (x0 y0 z0 x1 ...). */
export interface DataArray {
  name: string;
  association: Association;
  components: number;
  values: Float64Array;
}

/** The values of one view at one cycle; `points` are the coordinates. */
export interface DataFrame {
  kind: "data";
  view: string;
  topology: string;
  cycle: number;
  time: number;
  points: Float32Array;
  fields: DataArray[];
}

export type Frame = TopologyFrame | DataFrame;
type JsonObject = { [key: string]: Json };

const isObject = (value: unknown): value is JsonObject =>
  typeof value === "object" && value !== null && !Array.isArray(value);

/** Parses a text message: one object whose one key says what it is. */
export function parseServerMessage(text: string): ServerMessage {
  let parsed: unknown;
  try {
    parsed = JSON.parse(text);
  } catch {
    throw new ProtocolError("a text message that is not JSON");
  }
  if (!isObject(parsed)) throw new ProtocolError("a text message that is not a JSON object");
  for (const kind of ["hello", "status", "order", "parameters", "stack", "precision", "forecast", "monitor", "pipelines", "wheel", "kept", "done", "play", "end", "error",
    "link", "people", "followed", "camera", "note", "note_removed"] as const) {
    const body: unknown = parsed[kind];
    if (body === undefined) continue;
    if (!isObject(body)) throw new ProtocolError(`the message "${kind}" is not an object`);
    if (kind === "forecast" && !isObject(body.order)) throw new ProtocolError('the message "forecast" has no order');
    if (kind === "parameters" && !isObject(body.values)) throw new ProtocolError('the message "parameters" has no values');
    if (kind === "people" && !Array.isArray(body.viewers)) throw new ProtocolError('the message "people" has no viewers');
    return { kind, body: kind === "hello" ? completeHello(body) : body } as unknown as ServerMessage;
  }
  throw new ProtocolError(`an unknown message: ${Object.keys(parsed).slice(0, 3).join(", ") || "{}"}`);
}

function completeHello(body: JsonObject): ToldHello {
  if (body.protocol !== PROTOCOL_VERSION) throw new VersionError(body.protocol);
  const list = (key: string): Json[] => (Array.isArray(body[key]) ? body[key] : []);
  const object = (key: string): JsonObject => (isObject(body[key]) ? body[key] : {});
  return {
    ...body,
    views: list("views"), features: list("features"), fields: list("fields"), parameters: list("parameters"),
    orders: list("orders"), defaults: object("defaults"),
  } as unknown as ToldHello;
}
