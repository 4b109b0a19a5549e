/** Keeps the preview in step with the form: what is being composed there is seen in the picture before anything is sent. */
import { InputError } from "../form/controls";
import { part, write } from "../dom";
import type { PreviewInspection } from "../inspection";
import type { ShapeFaults } from "../kernel/kernel";
import { digits } from "../number";
import { Preview } from "./preview";
import type { PreviewShape, PreviewWorker } from "./preview";
import type { Json, SurfaceInformation } from "../connection/protocol";
import type { Scene } from "../picture/scene";

export class PreviewPanel {
  private preview: Preview | null = null;
  private surface: SurfaceInformation | null = null;
  private stack: Json[] = [];
  /** The edits that are previewed, as JSON; empty for none. */
  private shown = "";
  private seen: PreviewInspection = NOTHING;
  private points: Float32Array = new Float32Array(0);
  private text = "";
  private bones = false;

  /** `edits` reads the form; it throws an `InputError` as long as something is missing there. */
  constructor(
    private readonly scene: Scene, private readonly address: string, private readonly module: Promise<WebAssembly.Module>,
    private readonly edits: () => Json[],
  ) {}

  /** What the server says: the surface from which shapes are measured, and the edits that the shape has now. */
  set(surface: SurfaceInformation | null, stack: Json[]): void {
    const moved = JSON.stringify(stack) !== JSON.stringify(this.stack);
    this.surface = surface;
    this.stack = stack;
    this.preview?.offer(surface);
    if (moved && this.bones) this.showSkeleton(true);
    if (moved && this.shown !== "") {
      this.shown = "";
      this.changed();
    }
  }

  /** Something in the form is different. */
  changed(): void {
    let edits: Json[] = [];
    try {
      edits = this.edits();
    } catch (error) {
      if (!(error instanceof InputError)) throw error;
      // Half a number is typed on the way to a whole one: there is nothing to show for it.
    }
    if (edits.length === 0 || !this.surface) return this.clear();
    const text = JSON.stringify(edits);
    if (text === this.shown) return;
    this.shown = text;
    this.seen = { ...this.seen, state: "waiting", faults: null };
    this.started().show(this.stack, edits);
  }

  /** Other features are chosen: a preview that is there follows, but none begins. */
  chosen(): void {
    if (this.shown !== "") this.changed();
  }

  clear(): void {
    this.shown = "";
    if (this.preview) this.preview.clear();
    else this.cleared();
  }

  /** Shows the skeleton, by which the shape can be dragged, or takes it away. */
  showSkeleton(shown: boolean): void {
    this.bones = shown;
    if (shown) this.started().skeleton(this.stack);
    else this.scene.setBones(null);
  }

  inspect(): PreviewInspection {
    return { ...this.seen, bounds: this.scene.previewBounds };
  }

  /** The kernel is loaded when it is first needed. */
  private started(): Preview {
    if (this.preview) return this.preview;
    const worker = new Worker(new URL("./preview.worker.ts", import.meta.url), { type: "module" });
    this.module.then((module) => worker.postMessage({ module }), (error: unknown) => this.fail(String(error)));
    this.preview = new Preview(worker as unknown as PreviewWorker, () => fetchSurface(this.address), {
      surface: (surface) => this.scene.setPreviewSurface(surface),
      shape: (shape) => this.take(shape),
      checked: (faults) => this.judge(faults),
      skeleton: (bones, reason) => {
        if (!this.bones) return;
        this.scene.setBones(bones);
        if (bones === null) this.say("failed", `No skeleton: ${reason}`);
      },
      failed: (_, reason) => this.fail(reason),
      cleared: () => this.cleared(),
    });
    worker.addEventListener("error", (event) => this.fail(event.message || "the geometry kernel could not be started"));
    this.preview.offer(this.surface);
    return this.preview;
  }

  private take({ points, largest, asked, computing, newest }: PreviewShape): void {
    const { shown } = this;
    this.scene.setPreview(points, undefined, () => {
      // A wish that came while the picture was drawn is answered by a later one.
      if (newest && shown === this.shown) this.seen = { ...NOTHING, faults: this.seen.faults, state: "shown", largest, computing, milliseconds: performance.now() - asked };
    });
    this.points = points;
    this.text = largest > 0 ? `Preview: moves the surface by up to ${digits(largest, 4)}` : "Preview: nothing moves";
    this.say("shown", this.text);
  }

  private judge(faults: ShapeFaults | null): void {
    this.seen = { ...this.seen, faults: faults?.text ?? "" };
    if (!faults) return;
    this.scene.setPreview(this.points, faults.triangles);
    this.say("broken", `${this.text}. The surface would be broken: ${faults.text}`);
  }

  private fail(reason: string): void {
    this.seen = { ...NOTHING, state: "failed", reason };
    this.scene.setPreview(null);
    this.say("failed", `No preview: ${reason}`);
  }

  private cleared(): void {
    this.seen = NOTHING;
    this.scene.setPreview(null);
    this.say("none", "");
  }

  private say(state: PreviewInspection["state"] | "broken", text: string): void {
    const notice = part("preview");
    notice.hidden = text === "";
    notice.dataset.state = state;
    write(notice, text);
    part("cancel").hidden = state !== "shown" && state !== "broken";
  }
}

const NOTHING: PreviewInspection = { state: "none", largest: null, milliseconds: null, computing: null, bounds: null, reason: null, faults: null };

async function fetchSurface(address: string): Promise<ArrayBuffer> {
  const response = await fetch(address, { cache: "no-store", redirect: "error" });
  if (!response.ok) throw new Error((await response.text()).slice(0, 300).trim() || response.statusText);
  return response.arrayBuffer();
}
