/** Before and after side by side: a second picture of the moment that is kept, seen from where the first is, in its colours. */
import type { FeatureInformation, ViewInformation } from "../connection/protocol";
import { element, write } from "../dom";
import type { Look, Looks } from "../store/looks";
import type { Selection } from "../store/selection";
import type { Stand } from "./camera";
import type { Earlier } from "./earlier";
import { makeCanvas } from "./canvas";
import { Scene } from "./scene";
import type { Bar } from "./scene";
import type { Theme } from "./theme";

export interface CompareSource {
  views(): readonly ViewInformation[];
  looks(): Looks;
  features(): readonly FeatureInformation[];
  selection: Selection;
  /** It is shown now, or put away. */
  shown(isShown: boolean): void;
  trouble(message: string): void;
}

export class Compare {
  private readonly place = element("div", { class: "before-scene", role: "img", "aria-label": "The shape as it was before" });
  private readonly caption = element("p", { class: "caption" });
  private scene: Scene | null = null;
  private bars: readonly Bar[] = [];
  private shown = false;
  private stood = "";
  private theme: Theme = "dark";

  /** `main` is the picture of now. */
  constructor(private readonly root: HTMLElement, private readonly button: HTMLElement, private readonly main: Scene, private readonly earlier: Earlier, private readonly source: CompareSource) {
    const keep = element("button", { type: "button", class: "small", title: "Compares with what is there now, from now on", onclick: () => earlier.keepNow() }, "Keep this moment");
    root.append(this.place, element("div", { class: "captions" }, this.caption, keep));
    button.addEventListener("click", () => {
      this.show(!this.shown);
      // Each has half the room now, or all of it again.
      requestAnimationFrame(() => requestAnimationFrame(() => this.main.camera.fit()));
    });
  }

  /** Shows it as it was before the page was loaded again: the camera stands where it stood beside it. */
  restore(): void {
    if (!this.shown) this.show(true);
  }

  private show(isShown: boolean): void {
    this.shown = isShown;
    this.button.setAttribute("aria-pressed", String(isShown));
    this.root.hidden = !isShown;
    this.source.shown(isShown);
    if (!isShown) return;
    if (this.earlier.moment.size === 0) this.earlier.keepNow();
    this.scene ??= new Scene(this.place, makeCanvas(), this.source.selection, {
      bars: () => undefined,
      drawn: () => this.linkFrom(),
      trouble: (message) => this.source.trouble(message),
      lost: () => undefined,
    });
    this.scene.setTheme(this.theme);
    this.update();
  }

  setTheme(theme: Theme): void {
    this.theme = theme;
    this.scene?.setTheme(theme);
  }

  /** The picture of now was drawn. */
  follow(): void {
    if (!this.shown || !this.scene) return;
    const stand = this.main.camera.stand;
    if (!this.isNew(stand)) return;
    this.scene.camera.stand = stand;
  }

  setBars(bars: readonly Bar[]): void {
    const isOther = JSON.stringify(bars.map(({ key, range }) => [key, range])) !== JSON.stringify(this.bars.map(({ key, range }) => [key, range]));
    this.bars = bars;
    if (isOther) this.update();
  }

  /** Another moment is kept, or the views look otherwise. */
  update(): void {
    const { scene } = this;
    if (!this.shown || !scene) return;
    const { moment, label } = this.earlier;
    write(this.caption, label === "" ? "Nothing is kept yet: what there is when an order begins will be." : label);
    const views = this.source.views().filter(({ name }) => moment.has(name));
    scene.setFeatures(this.source.features().map(({ name }) => name));
    scene.setLooks(views, Object.fromEntries(Object.entries(this.source.looks()).map(([name, look]) => [name, this.alike(name, look)])), false);
    for (const { name } of views) {
      const { topology, frame } = moment.get(name)!;
      if (scene.layers.get(name)?.frame === frame) continue;
      scene.setTopology(topology);
      scene.setData(frame);
    }
    this.stood = "";
    this.follow();
  }

  /** The same colours stand for the same values on both sides. */
  private alike(name: string, look: Look): Look {
    const bar = this.bars.find(({ views }) => views.includes(name));
    return bar ? { ...look, range: { ...look.range, kind: "fixed", low: bar.range[0], high: bar.range[1] } } : look;
  }

  /** The camera of this picture was moved: that of the other goes with it. */
  private linkFrom(): void {
    if (!this.shown || !this.scene || this.stood === "") return;
    const stand = this.scene.camera.stand;
    if (this.isNew(stand)) this.main.camera.stand = stand;
  }

  private isNew(stand: Stand): boolean {
    const text = JSON.stringify(stand);
    if (text === this.stood) return false;
    this.stood = text;
    return true;
  }
}
