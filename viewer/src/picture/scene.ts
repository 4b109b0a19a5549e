/** The picture: a vtk.js render window that draws when something changed, and never waits for the network. */
import vtkRenderWindow from "@kitware/vtk.js/Rendering/Core/RenderWindow";
import vtkRenderer from "@kitware/vtk.js/Rendering/Core/Renderer";
import type vtkOpenGLRenderWindow from "@kitware/vtk.js/Rendering/OpenGL/RenderWindow";
import vtkRenderWindowInteractor from "@kitware/vtk.js/Rendering/Core/RenderWindowInteractor";
import { BonesPicture } from "./bones";
import type { Canvas } from "./canvas";
import { ChosenFaces } from "./chosen-faces";
import { EarlyFrames } from "./early-frames";
import { Ghost } from "./ghost";
import { Layer } from "./layer";
import { prepareContext, releaseResources, watchContext } from "./lost-context";
import { bounds } from "./picking";
import { Camera } from "./camera";
import type { Box, Covered } from "./camera";
import { Detail } from "./detail";
import { mouse } from "./mouse";
import { Pace } from "./pace";
import { Places } from "./places";
import { Ranges } from "./ranges";
import { Rhythm } from "./rhythm";
import { colour } from "./shared-colours";
import type { Bar } from "./shared-colours";
import { own } from "../own";
import type { Looks } from "../store/looks";
import { THEMES } from "./theme";
import type { Theme } from "./theme";
import type { PreviewSurface } from "../preview/preview";
import type { DataFrame, TopologyFrame, Vector, ViewInformation } from "../connection/protocol";
import type { Selection } from "../store/selection";
import type { Bones } from "./skeleton";

export type { Bar } from "./shared-colours";

export interface SceneEvents {
  /** What the colours stand for that are drawn now. */
  bars(bars: Bar[]): void;
  /** After each picture, with the directions of the axes on the screen. */
  drawn(axes: [number, number][]): void;
  trouble(message: string): void;
  /** The room that is left for what lies over the picture; none where this is missing. */
  covered?(): Covered;
  /** Whether the browser has taken away what draws. */
  lost(isLost: boolean): void;
}

/** What was drawn: the newest cycle in it, and a number made of all its pixels. */
export interface Picture { cycle: number | null; pixels: number }

export class Scene {
  readonly layers = new Map<string, Layer>();
  private readonly window = vtkRenderWindow.newInstance();
  private readonly renderer = vtkRenderer.newInstance();
  private readonly canvas: vtkOpenGLRenderWindow;
  private readonly pace: Pace;
  private readonly detail = new Detail(() => this.request());
  /** Whether what is drawn now is a film's, which is whole. */
  isFilmed = false;
  /** When the picture was begun that is being made up, and whether it is whole. */
  private begun = 0;
  private isWhole = true;
  private readonly interactor = vtkRenderWindowInteractor.newInstance();
  readonly camera: Camera;
  readonly places: Places;
  private readonly ranges = new Ranges();
  private readonly pending = new Map<string, DataFrame>();
  private readonly early = new EarlyFrames();
  /** These three are made when they are first shown. */
  private ghost: Ghost | null = null;
  private bones: BonesPicture | null = null;
  private chosen: ChosenFaces | null = null;
  private features: string[] = [];
  private held = false;
  /** Whether nothing was ever drawn. */
  private isEmpty = true;
  private theme: Theme = "dark";
  private readonly rhythm = new Rhythm({ isAnimating: () => this.interactor.isAnimating(), draw: () => this.draw() });
  private isPlacing = false;
  private isLost = false;
  /** Whether what is drawn next was brought up to what has come. */
  private isPrepared = false;
  private recolour = true;

  constructor(private readonly container: HTMLElement, { window, byProcessor }: Canvas, private readonly selection: Selection, private readonly events: SceneEvents) {
    this.canvas = window;
    this.pace = new Pace(byProcessor, () => this.fit());
    this.camera = new Camera(this.renderer, this.canvas, () => this.box(), () => {
      if (!this.isPlacing) this.request();
    }, () => this.pace.move(), events.covered);
    this.places = new Places(container, this.canvas, this.renderer, this.layers, () => this.features);
    this.window.addRenderer(this.renderer);
    this.window.addView(this.canvas);
    this.canvas.setContainer(container);
    this.interactor.setView(this.canvas);
    this.interactor.initialize();
    this.pace.follow(container);
    this.interactor.bindEvents(container);
    this.interactor.setInteractorStyle(mouse());
    // While an interaction draws pictures by itself, they hold what has come like any other.
    this.interactor.onAnimation(() => this.prepare());
    this.interactor.onEndAnimation(() => this.prepare());
    this.interactor.onRenderEvent(() => this.drawn());
    container.addEventListener("keypress", (event) => event.stopImmediatePropagation(), true);
    container.addEventListener("keydown", (event) => {
      if (this.camera.key(event)) this.pace.move();
    });
    new ResizeObserver(() => this.resize()).observe(container);
    selection.onChange(() => this.request());
    watchContext(this.canvas.getCanvas()!, (isLost) => this.lose(isLost));
    this.resize();
  }

  private lose(isLost: boolean): void {
    this.isLost = isLost;
    if (isLost) releaseResources(this.canvas, this.window.getRenderers());
    else prepareContext(this.canvas);
    // An interaction draws by itself, also nothing.
    this.interactor.set({ enableRender: !isLost });
    this.events.lost(isLost);
    this.request();
  }

  /** A renderer over the other one: what lies in the middle of a shape would be hidden by it. */
  private above(): vtkRenderer {
    const above = vtkRenderer.newInstance();
    above.setLayer(1);
    above.setInteractive(false);
    above.setActiveCamera(this.renderer.getActiveCamera());
    this.window.setNumberOfLayers(2);
    this.window.addRenderer(above);
    return above;
  }

  /** The surface that previews are shapes of. */
  setPreviewSurface(surface: PreviewSurface): void {
    this.ghost ??= new Ghost(this.renderer);
    this.ghost.setSurface(surface);
    this.request();
  }

  /** Shows the shape that an edit would make, with its broken triangles; null takes it away. `drawn` is called once it is seen. */
  setPreview(points: Float32Array | null, broken?: Uint32Array, drawn?: () => void): void {
    this.ghost?.setPoints(points, broken);
    if (points) {
      this.pace.move();
      this.detail.move();
      this.rhythm.shaped();
    }
    this.request(drawn);
  }

  /** Colours faces that are chosen, by the indices of their corners; none takes them away. */
  setChosenFaces(points: Float32Array, corners: Uint32Array): void {
    if (corners.length > 0) this.chosen ??= new ChosenFaces(this.renderer);
    this.chosen?.show(points, corners);
    this.request();
  }

  /** Shows a skeleton; null takes it away. */
  setBones(bones: Bones | null): void {
    if (bones) this.bones ??= new BonesPicture(this.above());
    this.bones?.show(bones);
    this.request();
  }

  get shownBones(): Bones | null {
    return this.bones?.shown ?? null;
  }

  /** The box around the preview that is drawn; null when there is none. */
  get previewBounds(): [Vector, Vector] | null {
    const points = this.ghost?.coordinates;
    return points ? bounds(points) : null;
  }

  /** The views that there are and how they look; those that are gone are removed. While `held`, automatic ranges stay as they are. */
  setLooks(views: readonly ViewInformation[], looks: Looks, held: boolean): void {
    const names = new Set(views.map((view) => view.name));
    for (const [name, layer] of this.layers) {
      if (names.has(name)) continue;
      layer.remove();
      this.layers.delete(name);
      this.pending.delete(name);
    }
    for (const { name, kind } of views) {
      const look = own(looks, name);
      if (!look) continue;
      const known = this.layers.get(name);
      const layer = known ?? new Layer(name, kind, look, this.renderer);
      layer.look = look;
      layer.setTheme(THEMES[this.theme].edge);
      this.layers.set(name, layer);
      for (const frame of known ? [] : this.early.take(name)) {
        if (frame.kind === "topology") this.setTopology(frame);
        else this.setData(frame);
      }
    }
    this.held = held;
    this.recolour = true;
    this.request();
  }

  setTheme(theme: Theme): void {
    this.theme = theme;
    this.renderer.setBackground(...THEMES[theme].background);
    for (const layer of this.layers.values()) layer.setTheme(THEMES[theme].edge);
    this.request();
  }

  setFeatures(names: string[]): void {
    this.features = names;
    this.request();
  }

  setTopology(frame: TopologyFrame): void {
    this.pending.delete(frame.view);
    const layer = this.layers.get(frame.view);
    if (layer) layer.setTopology(frame);
    else this.early.keep(frame);
  }

  /** Takes values to be drawn with the next picture; returns whether the view and its topology are known. */
  setData(frame: DataFrame): boolean {
    const layer = this.layers.get(frame.view);
    if (!layer) this.early.keep(frame);
    if (!layer?.topology || layer.topology.topology !== frame.topology) return false;
    this.pending.set(frame.view, frame);
    this.rhythm.requestGently();
    return true;
  }

  /** The newest coordinates of a feature, whether or not they are drawn yet. */
  featureBounds(name: string): [Vector, Vector] | null {
    const number = this.features.indexOf(name);
    if (number < 0) return null;
    for (const layer of this.layers.values()) {
      const { topology } = layer;
      if (!topology?.triangleFeatures) continue;
      const points = this.pending.get(layer.name)?.points ?? layer.coordinates;
      if (points.length !== topology.points * 3) continue;
      const found = bounds(points, topology.triangles, (triangle) => topology.triangleFeatures?.[triangle] === number);
      if (found) return found;
    }
    return null;
  }

  /** The box around all that is seen. */
  bounds(): [Vector, Vector] | null {
    const box = this.box();
    return box && [[box[0], box[2], box[4]], [box[1], box[3], box[5]]];
  }

  viewBounds(name: string): [Vector, Vector] | null {
    const layer = this.layers.get(name);
    if (!layer) return null;
    const pending = this.pending.get(name);
    return pending ? bounds(pending.points) : layer.bounds;
  }

  /** The views that are drawn. */
  *shown(): Iterable<Layer> {
    for (const layer of this.layers.values()) if (layer.look.visible) yield layer;
  }

  private box(): Box | null {
    const low = [Infinity, Infinity, Infinity];
    const high = [-Infinity, -Infinity, -Infinity];
    for (const layer of this.layers.values()) {
      const found = layer.look.visible ? layer.bounds : null;
      if (!found) continue;
      for (let k = 0; k < 3; k++) {
        low[k] = Math.min(low[k]!, found[0][k]!);
        high[k] = Math.max(high[k]!, found[1][k]!);
      }
    }
    return low[0]! <= high[0]! ? [low[0]!, high[0]!, low[1]!, high[1]!, low[2]!, high[2]!] : null;
  }

  private resize(): void {
    this.fit();
    // As much as there is room for: the page has grown or another panel is open.
    this.camera.refit();
  }

  /** Gives the canvas its pixels. */
  private fit(): void {
    const box = this.container.getBoundingClientRect();
    const ratio = (window.devicePixelRatio || 1) * this.pace.scale;
    this.canvas.setSize(Math.max(1, Math.floor(box.width * ratio)), Math.max(1, Math.floor(box.height * ratio)));
    this.request();
  }

  /** Has the picture drawn again, and what lies over it. */
  redraw(): void {
    this.request();
  }

  private request(drawn?: () => void): void {
    this.rhythm.request(drawn);
  }

  /** Draws all that has come, and says what was drawn. */
  picture(): Promise<Picture> {
    this.pace.rest();
    return new Promise((resolve) => this.rhythm.requestAll(() => {
      const cycles = [...this.layers.values()].flatMap((layer) => (layer.frame ? [layer.frame.cycle] : []));
      resolve({ cycle: cycles.length > 0 ? Math.max(...cycles) : null, pixels: this.pixels() });
    }));
  }

  /** The canvas itself, for what films it. */
  get element(): HTMLCanvasElement | null {
    return this.canvas.getCanvas() ?? null;
  }

  /** Draws all that has come; the canvas holds the picture until the task ends in which `taken` is called. */
  withPicture(taken: (canvas: HTMLCanvasElement) => void): void {
    this.pace.rest();
    this.rhythm.requestAll(() => {
      const canvas = this.canvas.getCanvas();
      if (canvas) taken(canvas);
    });
  }

  /** A number made of all pixels, each of four bytes (FNV-1a). They are there only in the task that has drawn them. */
  private pixels(): number {
    const [width, height] = this.canvas.getSize();
    const context = this.canvas.get3DContext({}) as WebGL2RenderingContext;
    const pixels = new Uint32Array(width * height);
    context.readPixels(0, 0, width, height, context.RGBA, context.UNSIGNED_BYTE, new Uint8Array(pixels.buffer));
    let hash = 0x811c9dc5;
    for (let i = 0; i < pixels.length; i++) hash = Math.imul(hash ^ pixels[i]!, 0x01000193);
    return hash >>> 0;
  }

  private draw(): void {
    this.prepare();
    // Until the first values are there the page says what is waited for: no time is spent on a picture of nothing.
    if (this.isEmpty || this.isLost) this.drawn();
    else this.window.render();
  }

  /** Brings what is about to be drawn up to what has come. */
  private prepare(): void {
    this.begun = performance.now();
    if (this.camera.hasMoved()) this.detail.move();
    const isCoarse = this.detail.isCoarse && !this.isFilmed && !this.rhythm.isAllWanted;
    this.isWhole = !isCoarse;
    if (this.pending.size > 0) {
      // A view with another topology is not seen until its values are there.
      const isMissing = [...this.pending.keys()].some((name) => this.layers.get(name)?.frame === null);
      if (this.rhythm.takesValues(isMissing)) this.take();
    }
    if (this.recolour) {
      this.recolour = false;
      this.events.bars(colour(this.layers.values(), this.ranges, this.held));
    }
    for (const layer of this.layers.values()) {
      const names = this.features;
      layer.highlight("handle", this.selection.chosen("handle", names), names);
      layer.highlight("fixed", this.selection.chosen("fixed", names), names);
      layer.highlight("hover", this.selection.hovered ? [this.selection.hovered] : [], names);
      layer.show(isCoarse);
    }
    this.isEmpty &&= [...this.layers.values()].every((layer) => layer.frame === null);
    if (!this.isEmpty) {
      if (!this.camera.isPlaced && this.box()) this.place();
      this.renderer.resetCameraClippingRange();
    }
    this.isPrepared = true;
  }

  /** Places the camera for the picture that is being made up: no other is asked for. */
  private place(): void {
    this.isPlacing = true;
    this.camera.reset();
    this.isPlacing = false;
  }

  /** Takes the values that have come. */
  private take(): void {
    for (const [name, frame] of this.pending) {
      const layer = this.layers.get(name);
      // In a recording one may go back, and another run begins anew: what comes then is not more of what was.
      if (layer && frame.cycle < layer.cycle) this.ranges.clear();
      const trouble = layer?.setData(frame) ?? null;
      if (trouble) this.events.trouble(trouble);
      else this.recolour = true;
    }
    this.pending.clear();
  }

  /** The picture was drawn: what lies over it follows, and who waits for it is told. */
  private drawn(): void {
    const matrix = this.renderer.getActiveCamera().getViewMatrix();
    this.events.drawn([0, 1, 2].map((axis) => [matrix[axis] ?? 0, matrix[4 + axis] ?? 0]));
    if (!this.isPrepared) return;
    this.isPrepared = false;
    if (this.isWhole && !this.isEmpty && !this.isLost) this.detail.measure(this.canvas.get3DContext({}) as WebGL2RenderingContext, this.begun);
    this.rhythm.drawn();
  }
}
