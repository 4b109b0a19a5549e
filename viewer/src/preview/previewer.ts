/** Keeps the preview in step with the form: what is being composed there is seen in the picture before anything is sent. */
import type { Json, SurfaceInformation } from "../connection/protocol";
import type { ShapeFaults } from "../kernel/kernel";
import type { Scene } from "../picture/scene";
import type { Action } from "../store/actions";
import { moverOf, wishedStack } from "../store/draft";
import { mayDrive } from "../store/run";
import { NO_PREVIEW } from "../store/state";
import type { PreviewState, State } from "../store/state";
import { sameJson } from "../store/store";
import type { Store } from "../store/store";
import { Preview } from "./preview";
import type { PreviewShape, PreviewSurface } from "./preview";

/** A surface with its points in the reference and in the shape that is. */
export interface ShownPoints extends PreviewSurface { reference: Float64Array; points: Float32Array }

/** A surface of more vertices than these comes when somebody asks for a preview, and not before. */
const PREPARED = 200_000;

export class Previewer {
  private preview: Preview | null = null;
  private wished: Json[] | null = null;
  /** What the preview that is shown or waited for is moved by. */
  private mover: Json = null;
  private features: string[] = [];
  private points: Float32Array = new Float32Array(0);
  private bones = false;
  private faulty: Uint32Array | undefined;
  private readonly surfaceListeners = new Set<(surface: ShownPoints) => void>();
  /** Hears why the skeleton that was asked for is not there. */
  noSkeleton: (reason: string) => void = () => undefined;
  /** Who waits for the points once. */
  private waiting: { resolve: (surface: ShownPoints) => void; reject: (reason: Error) => void }[] = [];
  private shown: PreviewSurface | null = null;

  constructor(
    private readonly scene: Scene, private readonly address: string, private readonly module: Promise<WebAssembly.Module>,
    private readonly store: Store<State, Action>,
  ) {
    store.watch((state) => state.hello?.surface ?? null, (surface) => this.preview?.offer(surface), sameJson);
    store.watch((state) => state.hello?.stack ?? [], () => {
      if (this.bones) this.showSkeleton(true);
      if (this.surfaceListeners.size > 0 || this.waiting.length > 0) this.started().surfacePoints(this.stack);
      this.show(this.wished);
    }, sameJson);
    store.watch(wishedStack, (wished) => this.show(wished), sameJson);
  }

  /** Has the kernel and the surface ready before the first preview, where this viewer may change the shape. */
  prepare(): void {
    if (this.surface && this.surface.vertices <= PREPARED && mayDrive(this.store.state)) this.started().prepare();
  }

  /** Tells the points of the surface, and of each shape that it takes from now on. */
  watchSurface(listener: (surface: ShownPoints) => void): void {
    this.surfaceListeners.add(listener);
    this.started().surfacePoints(this.stack);
  }

  /** The points of the surface in the shape that is now; rejected where they do not come. */
  surfaceNow(): Promise<ShownPoints> {
    return new Promise((resolve, reject) => {
      this.waiting.push({ resolve, reject });
      this.started().surfacePoints(this.stack);
    });
  }

  /** Ends the waiting for points. */
  private answerWaiting(answer: (one: (typeof this.waiting)[number]) => void): void {
    const { waiting } = this;
    this.waiting = [];
    waiting.forEach(answer);
  }

  /** Shows the skeleton, by which the shape can be dragged, or takes it away. */
  showSkeleton(shown: boolean): void {
    this.bones = shown;
    if (shown) this.started().skeleton(this.stack);
    else this.scene.setBones(null);
  }

  private loseSkeleton(reason: string): void {
    this.showSkeleton(false);
    this.noSkeleton(reason);
  }

  private get stack(): Json[] {
    return this.store.state.hello?.stack ?? [];
  }

  private get surface(): SurfaceInformation | null {
    return this.store.state.hello?.surface ?? null;
  }

  private show(wished: Json[] | null): void {
    this.wished = wished;
    if (!wished || !this.surface) {
      if (this.preview) this.preview.clear();
      else this.say(NO_PREVIEW);
      return;
    }
    const mover = moverOf(this.store.state);
    const { preview } = this.store.state;
    // Another amount moves about the same features; another handle may move others, of which nothing is known yet.
    const moved = sameJson(mover, this.mover) ? preview.moved : null;
    this.mover = mover;
    this.say({ ...preview, state: "waiting", moved, faults: null, brokenIn: [] });
    this.started().show(this.stack, wished);
  }

  /** The kernel is started when it is first needed. */
  private started(): Preview {
    if (this.preview) return this.preview;
    const worker = new Worker(new URL("./preview.worker.ts", import.meta.url), { type: "module" });
    const preview = new Preview(worker, () => fetchSurface(this.address), {
      surface: (surface) => this.takeSurface(surface),
      shape: (shape) => this.take(shape),
      checked: (faults, isNewest) => this.judge(faults, isNewest),
      points: (reference, points) => {
        if (!this.shown) return;
        const surface = { ...this.shown, reference, points };
        for (const listener of [...this.surfaceListeners]) listener(surface);
        this.answerWaiting(({ resolve }) => resolve(surface));
      },
      noPoints: (reason) => this.answerWaiting(({ reject }) => reject(new Error(reason))),
      skeleton: (bones, reason) => {
        if (!this.bones) return;
        if (bones === null) this.loseSkeleton(reason);
        else this.scene.setBones(bones);
      },
      failed: (_, reason) => this.fail(reason),
      cleared: () => {
        this.scene.setPreview(null);
        this.followBones(null);
        this.faulty = undefined;
        this.say(NO_PREVIEW);
      },
    });
    this.preview = preview;
    // Nothing that was asked of it comes: the next wish is another's.
    const failed = (reason: string): void => {
      if (this.preview !== preview) return;
      this.preview = null;
      worker.terminate();
      this.answerWaiting(({ reject }) => reject(new Error(reason)));
      preview.offer(null);
      if (this.bones) this.loseSkeleton(reason);
      this.fail(reason);
    };
    this.module.then((module) => worker.postMessage({ module }), (error: unknown) => failed(String(error)));
    worker.addEventListener("error", (event) => failed(event.message || "the geometry kernel could not be started"));
    preview.offer(this.surface);
    return preview;
  }

  private takeSurface(surface: PreviewSurface): void {
    this.features = surface.features;
    this.shown = surface;
    if (this.surfaceListeners.size > 0) this.preview?.surfacePoints(this.stack);
    this.scene.setPreviewSurface(surface);
  }

  private take({ points, nodes, largest, moved, size, asked, computing, newest }: PreviewShape): void {
    const { wished } = this;
    this.points = points;
    this.followBones(nodes);
    this.scene.setPreview(points, this.faulty, () => {
      // A wish that came while the picture was drawn is answered by a later one.
      if (!newest || wished !== this.wished) return;
      const byName = Object.fromEntries(this.features.map((name, i) => [name, moved[i] ?? 0]));
      const { faults, brokenIn } = this.store.state.preview;
      this.say({ ...NO_PREVIEW, faults, brokenIn, state: "shown", largest, moved: byName, size, computing, milliseconds: performance.now() - asked });
    });
  }

  /** The skeleton goes with the shape that is previewed; null brings it back to the one that is. */
  private followBones(preview: Float32Array | null): void {
    const bones = this.scene.shownBones;
    if (this.bones && bones && bones.preview !== preview) this.scene.setBones({ ...bones, preview });
  }

  /** Colours what is wrong with the shape, also while the hand goes on; the verdict waits for the shape at which it rests. */
  private judge(faults: ShapeFaults | null, isNewest: boolean): void {
    if (isNewest) this.say({ ...this.store.state.preview, faults: faults?.text ?? "", brokenIn: faults ? this.featuresWith(faults.triangles) : [] });
    if (faults || this.faulty) this.scene.setPreview(this.points, faults?.triangles);
    this.faulty = faults?.triangles;
  }

  /** The features that triangles lie in; none where one of them is of no feature. */
  private featuresWith(triangles: Uint32Array): string[] {
    const numbers = new Set([...triangles].map((triangle) => this.shown?.triangleFeatures[triangle]));
    const names = [...numbers].map((number) => (number === undefined ? undefined : this.features[number]));
    return names.every((name) => name !== undefined) ? names : [];
  }

  private fail(reason: string): void {
    this.scene.setPreview(null);
    this.say({ ...NO_PREVIEW, state: "failed", reason });
  }

  private say(preview: PreviewState): void {
    if (!sameJson(preview, this.store.state.preview)) this.store.dispatch({ type: "preview", preview });
  }
}

async function fetchSurface(address: string): Promise<ArrayBuffer> {
  const response = await fetch(address, { cache: "no-store", redirect: "error" });
  if (!response.ok) throw new Error((await response.text()).slice(0, 300).trim() || response.statusText);
  return response.arrayBuffer();
}
