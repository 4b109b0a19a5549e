/** The toolbar over the picture: the camera; and the theme of the page. */
import { write } from "../dom";
import type { Scene } from "../picture/scene";
import type { Theme } from "../picture/theme";
import type { Kept } from "../store/kept";

/** Buttons with `data-camera`: the whole, along an axis (again from the other side), parallel projection. */
export class CameraTools {
  private side: 1 | -1 = 1;
  private looking = "";

  constructor(root: HTMLElement, private readonly scene: Scene) {
    root.addEventListener("click", (event) => {
      const button = (event.target as HTMLElement).closest("button");
      const camera = button?.dataset.camera;
      if (!button || !camera) return;
      if (camera === "parallel") {
        this.scene.parallel = !this.scene.parallel;
        button.setAttribute("aria-pressed", String(this.scene.parallel));
      } else this.look(camera);
    });
  }

  private look(camera: string): void {
    if (camera === "reset") this.scene.reset();
    else if (camera === "corner") this.scene.corner();
    else {
      this.side = this.looking === camera ? (this.side === 1 ? -1 : 1) : camera === "1" ? -1 : 1;
      this.scene.axis(Number(camera) as 0 | 1 | 2, this.side);
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
