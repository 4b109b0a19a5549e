/**
 * The preview of an edit: the shape that it would make, computed in this browser from the reference surface.
 *
 * The surface is asked for once, when the first preview needs it or before that (`prepare`); from then on nothing waits for the network. While one preview is
 * computed the newest wish waits and those before it are forgotten, so that a preview never falls behind the hand that makes it.
 */
import type { Json, SurfaceInformation } from "../connection/protocol";
import type { ShapeFaults } from "../kernel/kernel";
import type { FailureKind } from "../kernel/module";
import type { PreviewAnswer, PreviewRequest } from "./preview.worker";
import type { Bones } from "../picture/skeleton";

/** What computes: a Worker, or something that looks like one in a test. */
export interface PreviewWorker {
  onmessage: ((event: MessageEvent<PreviewAnswer>) => void) | null;
  postMessage(request: PreviewRequest, transfer: Transferable[]): void;
}

export interface PreviewSurface { triangles: Uint32Array; triangleFeatures: Uint32Array; features: string[] }
/**
 * A shape: its points, how far the edits move any of them and each feature, the size of the surface, when it was asked for, and the milliseconds that the kernel took.
 * `newest` says whether nothing newer is wished for already.
 */
export interface PreviewShape { points: Float32Array; /** Those of the skeleton, where it is known. */ nodes: Float32Array | null; largest: number; moved: number[]; size: number; asked: number; computing: number; newest: boolean }

export interface PreviewEvents {
  surface(surface: PreviewSurface): void;
  shape(shape: PreviewShape): void;
  /** What is wrong with a shape that was shown; null where it is sound. `isNewest` says whether no other is wished for. */
  checked(faults: ShapeFaults | null, isNewest: boolean): void;
  /** The skeleton that was asked for; or why there is none. */
  skeleton(bones: Bones | null, reason: string): void;
  /** The points of the surface that were asked for, in the reference and in the shape that is. */
  points(reference: Float64Array, now: Float32Array): void;
  /** The points that were asked for do not come. */
  noPoints(reason: string): void;
  /** An edit that cannot be previewed, or nothing to preview it with. */
  failed(kind: FailureKind | "surface-missing", reason: string): void;
  cleared(): void;
}

/** Milliseconds without a new wish after which a shape is looked at. */
const REST = 120;

/**
 * While the hand goes on, shapes are looked at no more often than so many milliseconds, and for no more than this part of the time: the shape
 * that is wished for meanwhile waits.
 */
const LOOK = { apart: 250, part: 0.04 };

interface Wish { stack: Json[]; wished: Json[]; at: number }

export class Preview {
  private known: string | null = null;
  private state: "absent" | "fetching" | "ready" = "absent";
  private waiting: Wish | null = null;
  private wanted: Json[] | null = null;
  private wantedPoints: Json[] | null = null;
  /** Whether points were asked for that have not come. */
  private isAwaitingPoints = false;
  /** Of the last look at a shape: when it was over, and how long it took. */
  private looked = { at: 0, took: 0 };
  private lookedSince = 0;
  /** Shapes up to this one were taken away. */
  private forgotten = 0;
  private computing: { number: number; at: number } | null = null;
  private number = 0;
  private resting: ReturnType<typeof setTimeout> | undefined;

  constructor(
    private readonly worker: PreviewWorker,
    private readonly fetchSurface: () => Promise<ArrayBuffer>,
    private readonly events: PreviewEvents,
  ) {
    worker.onmessage = (event) => this.answer(event.data);
  }

  /** Which surface the server measures shapes from; null when it has none. */
  offer(surface: SurfaceInformation | null): void {
    const id = surface?.id ?? null;
    if (id === this.known) return;
    this.known = id;
    this.state = "absent";
    this.wanted = null;
    this.wantedPoints = null;
    // What was asked of the one before is not answered any more.
    this.withoutPoints("the simulation has another surface now");
    this.clear();
  }

  /** Has the surface here before anything is wished for, so that the first preview need not wait for it. */
  prepare(): void {
    if (this.known !== null && this.state === "absent") void this.fetch();
  }

  /** Asks for the skeleton of the shape that `stack` has made. */
  skeleton(stack: Json[]): void {
    if (this.known === null) return this.events.skeleton(null, "the simulation has no reference surface");
    this.wanted = stack;
    this.next();
  }

  /** Asks for the points of the surface, in the reference and in the shape that `stack` has made. */
  surfacePoints(stack: Json[]): void {
    if (this.known === null) return this.events.noPoints("the simulation has no reference surface");
    this.wantedPoints = stack;
    this.isAwaitingPoints = true;
    this.next();
  }

  /** Whether there is a surface to preview edits of. */
  get possible(): boolean {
    return this.known !== null;
  }

  /** Asks for the shape of the edits `wished`, and how far it is from the one that `stack` has made. */
  show(stack: Json[], wished: Json[]): void {
    if (this.known === null) return;
    clearTimeout(this.resting);
    this.waiting = { stack, wished, at: performance.now() };
    this.next();
  }

  /** Takes the preview away; what is still computed for it is not shown. */
  clear(): void {
    clearTimeout(this.resting);
    this.waiting = null;
    this.forgotten = ++this.number;
    this.events.cleared();
  }

  private next(): void {
    if (this.wanted !== null) {
      if (this.state === "absent") return void this.fetch();
      if (this.state === "ready" && this.known !== null) {
        this.worker.postMessage({ skeleton: this.known, stack: this.wanted }, []);
        this.wanted = null;
      }
    }
    if (this.wantedPoints !== null && this.known !== null) {
      if (this.state === "absent") return void this.fetch();
      if (this.state === "ready") {
        this.worker.postMessage({ shape: this.known, stack: this.wantedPoints }, []);
        this.wantedPoints = null;
      }
    }
    if (this.waiting === null || this.computing !== null) return;
    if (this.state === "absent") void this.fetch();
    if (this.state !== "ready") return;
    const { stack, wished, at } = this.waiting;
    this.waiting = null;
    this.computing = { number: ++this.number, at };
    this.worker.postMessage({ number: this.number, stack, wished }, []);
  }

  /** Looks at a shape, which may take longer than the shape itself: at once now and then, and in any case when the hand rests. */
  private check(shown: { number: number; at: number }): void {
    if (this.computing !== null || shown.number !== this.number) return;
    this.computing = shown;
    this.lookedSince = performance.now();
    this.worker.postMessage({ check: shown.number }, []);
  }

  private isLookDue(): boolean {
    const now = performance.now();
    // A hand that has just begun waits for nothing.
    if (this.number <= this.forgotten + 1) this.looked.at = now;
    return now - this.looked.at > Math.max(LOOK.apart, this.looked.took / LOOK.part);
  }

  private async fetch(): Promise<void> {
    const id = this.known;
    if (id === null) return;
    this.state = "fetching";
    try {
      const surface = await this.fetchSurface();
      if (id === this.known) this.worker.postMessage({ id, surface }, [surface]);
    } catch (error) {
      if (id === this.known) this.without("surface-missing", error instanceof Error ? error.message : String(error));
    }
  }

  /** There is no surface; the next wish asks for it again. Where nothing is wished for yet, nobody need hear of it; of the skeleton is told by itself. */
  private without(kind: FailureKind | "surface-missing", reason: string): void {
    const isWanted = this.waiting !== null || this.wantedPoints !== null;
    this.state = "absent";
    this.waiting = null;
    if (this.wanted !== null) this.events.skeleton(null, reason);
    this.wanted = null;
    this.wantedPoints = null;
    this.withoutPoints(reason);
    if (isWanted) this.events.failed(kind, reason);
  }

  private withoutPoints(reason: string): void {
    if (!this.isAwaitingPoints) return;
    this.isAwaitingPoints = false;
    this.events.noPoints(reason);
  }

  private answer(answer: PreviewAnswer): void {
    if ("id" in answer) {
      if (answer.id !== this.known) return;
      if ("error" in answer) return this.without(answer.kind, answer.error);
      this.state = "ready";
      this.events.surface(answer.surface);
    } else if ("skeleton" in answer) {
      if (answer.skeleton !== this.known) return;
      if ("error" in answer) this.events.skeleton(null, answer.error);
      else this.events.skeleton(answer.bones, "");
    } else if ("shape" in answer) {
      if (answer.shape !== this.known) return;
      if ("error" in answer) {
        this.withoutPoints(answer.error);
        this.events.failed(answer.kind, answer.error);
      } else {
        this.isAwaitingPoints = false;
        this.events.points(answer.reference, answer.points);
      }
    } else if ("check" in answer) {
      this.computing = null;
      const at = performance.now();
      this.looked = { at, took: at - this.lookedSince };
      if (answer.check > this.forgotten) this.events.checked("faults" in answer ? answer.faults : null, this.waiting === null);
    } else {
      const asked = this.computing;
      this.computing = null;
      // One that was taken away or overtaken meanwhile is not shown.
      if (asked?.number === this.number) {
        if ("error" in answer) this.events.failed(answer.kind, answer.error);
        else {
          const { points, nodes, largest, moved, size, milliseconds } = answer;
          this.events.shape({ points, nodes, largest, moved, size, asked: asked.at, computing: milliseconds, newest: this.waiting === null });
          if (this.isLookDue()) this.check(asked);
          else this.resting = setTimeout(() => this.check(asked), REST);
        }
      }
    }
    this.next();
  }
}
