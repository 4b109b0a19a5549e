/** The views that the simulation streams: which are seen, how opaque, and which carry the colours. */
import type { ViewInformation } from "../connection/protocol";
import { element, identifier } from "../dom";
import type { Scene } from "../picture/scene";

export class ViewList {
  private key = "";

  constructor(private readonly root: HTMLElement, private readonly scene: Scene) {}

  set(views: readonly ViewInformation[]): void {
    const key = JSON.stringify(views);
    if (key === this.key) return;
    this.key = key;
    this.root.replaceChildren(...views.map((view) => this.row(view)));
    if (views.length === 0) this.root.replaceChildren(element("p", { class: "hint" }, "No views are streamed."));
  }

  private row(view: ViewInformation): HTMLElement {
    const layer = this.scene.layers.get(view.name);
    const id = identifier("view");
    const slider = element("input", {
      type: "range", min: 0, max: 100, step: 5, value: Math.round((layer?.opacity ?? 1) * 100), "aria-label": `opacity of ${view.name}`,
      title: "opacity", oninput: () => this.scene.setOpacity(view.name, Number(slider.value) / 100),
    });
    const box = element("input", {
      type: "checkbox", id, onchange: () => {
        this.scene.setVisible(view.name, box.checked);
        slider.disabled = !box.checked;
      },
    });
    box.checked = layer?.visible ?? true;
    const coloured = element("input", {
      type: "checkbox", "aria-label": `${view.name}: coloured by the field`,
      onchange: () => this.scene.setColoured(view.name, coloured.checked),
    });
    coloured.checked = layer?.coloured ?? true;
    return element("div", { class: "view", "data-view": view.name }, box,
      element("label", { for: id }, view.name, view.kind === view.name ? null : element("small", {}, view.kind)),
      element("label", { class: "coloured", title: "colour by the field" }, coloured, "field"), slider);
  }
}
