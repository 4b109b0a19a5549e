/** The toolbar over the picture: the camera; and the theme of the page. */
import { part, textField, write } from "../dom";
import type { Scene } from "../picture/scene";
import type { Theme } from "../picture/theme";
import type { Kept } from "../store/kept";
import { takeMiddle } from "./click-tools";

/** Buttons with `data-camera`: the whole, along an axis (again from the other side), parallel projection. */
export class CameraTools {
  private side: 1 | -1 = 1;
  private looking = "";

  constructor(private readonly root: HTMLElement, private readonly scene: Scene) {
    // What is said over the picture stands below the buttons, however many rows they take.
    new ResizeObserver(() => document.body.style.setProperty("--tools-height", `${root.offsetHeight}px`)).observe(root);
    root.addEventListener("click", (event) => {
      const button = (event.target as HTMLElement).closest("button");
      const camera = button?.dataset.camera;
      if (!button || !camera) return;
      if (camera === "parallel") {
        this.scene.camera.parallel = !this.scene.camera.parallel;
        this.show();
      } else this.look(camera);
    });
  }

  /** Shows how the camera is, which something else has changed. */
  show(): void {
    this.root.querySelector('[data-camera="parallel"]')?.setAttribute("aria-pressed", String(this.scene.camera.parallel));
  }

  private look(camera: string): void {
    if (camera === "reset") this.scene.camera.reset();
    else if (camera === "corner") this.scene.camera.corner();
    else {
      this.side = this.looking === camera ? (this.side === 1 ? -1 : 1) : camera === "1" ? -1 : 1;
      this.scene.camera.axis(Number(camera) as 0 | 1 | 2, this.side);
    }
    this.looking = camera;
  }
}

/** Light or dark: as the system has it, until somebody chooses. */
export class Theming {
  constructor(private readonly button: HTMLButtonElement, private readonly kept: Kept, private readonly applied: (theme: Theme) => void) {
    const system = window.matchMedia("(prefers-color-scheme: light)");
    button.addEventListener("click", () => {
      this.kept.theme = this.theme === "dark" ? "light" : "dark";
      this.apply();
    });
    system.addEventListener("change", () => this.apply());
    this.apply();
  }

  private get theme(): Theme {
    return this.kept.theme ?? (window.matchMedia("(prefers-color-scheme: light)").matches ? "light" : "dark");
  }

  private apply(): void {
    const { theme } = this;
    document.documentElement.dataset.theme = theme;
    write(this.button, theme === "dark" ? "Light" : "Dark");
    this.button.title = theme === "dark" ? "A light page" : "A dark page";
    this.applied(theme);
  }
}

export interface PictureTools {
  /** Plots what lies at a place of the page; returns whether that is the model. */
  pin(clientX: number, clientY: number): boolean;
  unpin(): void;
  /** Switches a tool that takes clicks on or off, by its button. */
  use(button: "ruler" | "line" | "note"): void;
  save(): void;
  /** Begins a film, or ends it. */
  movie(): void;
}

/** What else can be done with the picture, by buttons and by keys: plot a place, measure, save, the picture alone, the list of keys. */
export function watchPictureTools(picture: HTMLElement, stage: HTMLElement, tools: PictureTools): void {
  let pointer: { x: number; y: number } | null = null;
  picture.addEventListener("pointermove", (event) => { pointer = { x: event.clientX, y: event.clientY }; });
  picture.addEventListener("pointerleave", () => { pointer = null; });
  picture.addEventListener("pointerdown", () => picture.focus({ preventScroll: true }));
  picture.addEventListener("contextmenu", (event) => event.preventDefault());
  const keys = part("keys") as HTMLDialogElement;
  const fullScreen = (): void => {
    if (document.fullscreenElement) void document.exitFullscreen();
    else void stage.requestFullscreen?.().catch(() => undefined);
  };
  part("movie").addEventListener("click", () => tools.movie());
  part("screenshot").addEventListener("click", () => tools.save());
  part("full-screen").addEventListener("click", fullScreen);
  part("keys-button").addEventListener("click", () => keys.showModal());
  part("keys-close").addEventListener("click", () => keys.close());
  const actions: Record<string, () => void> = {
    p: () => {
      if (pointer) tools.pin(pointer.x, pointer.y);
      else takeMiddle(picture, tools.pin);
    },
    P: () => tools.unpin(),
    m: () => tools.use("ruler"), l: () => tools.use("line"), n: () => tools.use("note"), s: () => tools.save(), f: fullScreen,
  };
  window.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const target = event.target as HTMLElement | null;
    // In a list of choices a letter looks for one.
    const typing = textField(target) ?? target?.closest?.("select, dialog") ?? null;
    // A letter is for the picture where the pointer or the focus is there.
    const action = event.key === "?" ? () => keys.showModal() : pointer || target === picture ? actions[event.key] : undefined;
    if (typing || event.defaultPrevented || !action) return;
    event.preventDefault();
    action();
  });
}
