/** Where the picture is seen from: the whole, along an axis, close to a place; by keys; and linked with another picture. */
import type vtkOpenGLRenderWindow from "@kitware/vtk.js/Rendering/OpenGL/RenderWindow";
import type vtkRenderer from "@kitware/vtk.js/Rendering/Core/Renderer";
import type { Vector } from "../connection/protocol";

/** The box around what is seen: the least and the largest x, then y, then z. */
export type Box = [number, number, number, number, number, number];

/** How a camera stands; `middle` is where in the picture its focal point is drawn, from -1 to 1, which each picture has for itself unless it is linked with another. */
export interface Stand { position: Vector; focalPoint: Vector; viewUp: Vector; parallel: boolean; parallelScale: number; viewAngle: number; middle?: [number, number] }

/** How far what lies over the picture reaches into it from each side, as parts of its width and height. */
export interface Covered { left: number; right: number; top: number; bottom: number }
const NOTHING: Covered = { left: 0, right: 0, top: 0, bottom: 0 };
/** What a key with shift moves what is seen by: to the right and up, as parts of the height of the picture. */
const PANS: Readonly<Record<string, readonly [number, number]>> = { ArrowLeft: [-0.08, 0], ArrowRight: [0.08, 0], ArrowUp: [0, 0.08], ArrowDown: [0, -0.08] };
/** The part of the free room that the whole takes. */
const FILLED = 0.9;

export class Camera {
  /** Where it stood when `reset` had put the whole into the picture; null where it never did. */
  private whole: string | null = null;
  /** Where it stood when that was last asked. */
  private last = "";
  /** Whether it was put anywhere yet. */
  isPlaced = false;

  /** `box` is around what is seen; `request` is called when it stands elsewhere, and `moved` when it follows another one; `covered` is room to be left. */
  constructor(
    private readonly renderer: vtkRenderer, private readonly canvas: vtkOpenGLRenderWindow,
    private readonly box: () => Box | null, private readonly request: () => void, private readonly moved: () => void,
    private readonly covered: () => Covered = () => NOTHING,
  ) {}

  private place(): string {
    const camera = this.renderer.getActiveCamera();
    // A key zooms by the angle of view, and in parallel projection by the scale: the position stays.
    return JSON.stringify([camera.getPosition(), camera.getViewAngle(), camera.getParallelScale()]);
  }

  /** The picture has another size: as much of it as there is room for, where nobody has moved the camera since `reset`. */
  refit(): void {
    if (this.isWhole) this.reset();
  }

  /** Whether it shows the whole: nobody has moved it since `reset`. */
  get isWhole(): boolean {
    return this.whole === this.place();
  }

  get stand(): Stand {
    const camera = this.renderer.getActiveCamera();
    return {
      position: [...camera.getPosition()] as Vector, focalPoint: [...camera.getFocalPoint()] as Vector, viewUp: [...camera.getViewUp()] as Vector,
      parallel: camera.getParallelProjection(), parallelScale: camera.getParallelScale(), viewAngle: camera.getViewAngle(),
      middle: camera.getWindowCenter().map((part) => -part || 0) as [number, number],
    };
  }

  /** Whether it stands elsewhere than when this was last asked; that it stands anywhere at all is no movement. */
  hasMoved(): boolean {
    const now = JSON.stringify(this.stand);
    const isOther = this.isPlaced && this.last !== "" && now !== this.last;
    this.last = this.isPlaced ? now : "";
    return isOther;
  }

  set stand(stand: Stand) {
    const { position, focalPoint, viewUp, parallel, parallelScale, viewAngle, middle } = stand;
    if (this.isPlaced && JSON.stringify(stand) !== JSON.stringify(this.stand)) this.moved();
    this.isPlaced = true;
    this.whole = null;
    const camera = this.renderer.getActiveCamera();
    camera.setPosition(...position);
    camera.setFocalPoint(...focalPoint);
    camera.setViewUp(...viewUp);
    camera.setParallelProjection(parallel);
    camera.setParallelScale(parallelScale);
    camera.setViewAngle(viewAngle);
    if (middle) camera.setWindowCenter(-middle[0], -middle[1]);
    this.renderer.resetCameraClippingRange();
    this.request();
  }

  /** The whole in the picture, seen across its flat side. */
  reset(): void {
    const box = this.box();
    if (!box) return;
    const size = [box[1] - box[0], box[3] - box[2], box[5] - box[4]];
    const order = [0, 1, 2].sort((a, b) => size[a]! - size[b]!);
    const direction: Vector = [0, 0, 0];
    direction[order[0]!] = 1;
    direction[order[1]!] = 0.32;
    direction[order[2]!] = order[0] === 1 ? -0.32 : 0.32;
    this.look(direction, order[0] === 2 ? [0, 1, 0] : [0, 0, 1]);
    this.whole = this.place();
    this.isPlaced = true;
  }

  /** As much as there is room for, seen from the same direction. */
  fit(): void {
    const camera = this.renderer.getActiveCamera();
    const [from, to] = [camera.getPosition(), camera.getFocalPoint()];
    this.look([0, 1, 2].map((k) => from[k]! - to[k]!) as Vector, [...camera.getViewUp()] as Vector);
  }

  /** Looks along an axis, from its positive side or its negative one. */
  axis(axis: 0 | 1 | 2, sign: 1 | -1): void {
    const direction: Vector = [0, 0, 0];
    direction[axis] = sign;
    this.look(direction, axis === 2 ? [0, 1, 0] : [0, 0, 1]);
  }

  /** Takes the camera close to a place, seen from where it is now. */
  flyTo(place: Vector): void {
    const box = this.box();
    if (!box) return;
    const camera = this.renderer.getActiveCamera();
    const [from, to] = [camera.getPosition(), camera.getFocalPoint()];
    const away = [0, 1, 2].map((k) => from[k]! - to[k]!);
    const length = Math.hypot(...away) || 1;
    const distance = 0.15 * Math.hypot(box[1] - box[0], box[3] - box[2], box[5] - box[4]);
    camera.setFocalPoint(...place);
    camera.setPosition(...([0, 1, 2].map((k) => place[k]! + (distance * away[k]!) / length) as Vector));
    if (this.parallel) camera.setParallelScale(distance / 3);
    this.renderer.resetCameraClippingRange();
    this.request();
  }

  /** Looks from a corner, so that all three directions are seen. */
  corner(): void {
    this.look([1, -1.4, 0.8], [0, 0, 1]);
  }

  get parallel(): boolean {
    return this.renderer.getActiveCamera().getParallelProjection();
  }

  set parallel(parallel: boolean) {
    this.renderer.getActiveCamera().setParallelProjection(parallel);
    this.request();
  }

  private look(direction: Vector, up: Vector): void {
    const box = this.box();
    if (!box) return;
    const camera = this.renderer.getActiveCamera();
    const center: Vector = [(box[0] + box[1]) / 2, (box[2] + box[3]) / 2, (box[4] + box[5]) / 2];
    camera.setFocalPoint(...center);
    camera.setPosition(center[0] + direction[0], center[1] + direction[1], center[2] + direction[2]);
    camera.setViewUp(...up);
    camera.orthogonalizeViewUp();
    this.renderer.resetCamera(box);
    this.fill(box);
    this.request();
  }

  /** Moves closer until the box fills the room that nothing lies over: vtk.js leaves room for a sphere around it, in the middle. */
  private fill(box: Box): void {
    const camera = this.renderer.getActiveCamera();
    camera.setWindowCenter(0, 0);
    const { left, right, top, bottom } = this.covered();
    const room = [2 - 2 * left - 2 * right, 2 - 2 * top - 2 * bottom];
    const [across, down] = this.seen(box);
    const larger = Math.max((across[1] - across[0]) / room[0]!, (down[1] - down[0]) / room[1]!);
    if (larger > 0) camera.zoom(Math.min(6, FILLED / larger));
    // The focal point stays what the camera turns about: it is drawn elsewhere.
    const [[west, east], [south, north]] = this.seen(box);
    camera.setWindowCenter((west + east) / 2 - (left - right), (south + north) / 2 - (bottom - top));
  }

  /** From where to where a box is seen across the picture, and from its lower end to its upper one, of -1 to 1. */
  private seen(box: Box): [[number, number], [number, number]] {
    const [width, height] = this.canvas.getSize();
    const places = Array.from({ length: 8 }, (_, corner) => this.canvas.worldToDisplay(box[corner & 1]!, box[2 + ((corner >> 1) & 1)]!, box[4 + (corner >> 2)]!, this.renderer));
    const [x, y] = [places.map((place) => (2 * place[0]) / width - 1), places.map((place) => (2 * place[1]) / height - 1)];
    return [[Math.min(...x), Math.max(...x)], [Math.min(...y), Math.max(...y)]];
  }

  /** Moves what is seen across the picture, by parts of its height to the right and up. */
  private pan(right: number, up: number): void {
    const camera = this.renderer.getActiveCamera();
    const [from, to, above] = [camera.getPosition(), camera.getFocalPoint(), camera.getViewUp()];
    const ahead = [0, 1, 2].map((k) => to[k]! - from[k]!);
    const height = this.parallel ? 2 * camera.getParallelScale() : 2 * Math.hypot(...ahead) * Math.tan((camera.getViewAngle() * Math.PI) / 360);
    const across = [0, 1, 2].map((k) => ahead[(k + 1) % 3]! * above[(k + 2) % 3]! - ahead[(k + 2) % 3]! * above[(k + 1) % 3]!);
    const [length, size] = [Math.hypot(...across) || 1, Math.hypot(...above) || 1];
    // The camera goes the other way.
    const by = [0, 1, 2].map((k) => -height * ((right * across[k]!) / length + (up * above[k]!) / size));
    camera.setPosition(...([0, 1, 2].map((k) => from[k]! + by[k]!) as Vector));
    camera.setFocalPoint(...([0, 1, 2].map((k) => to[k]! + by[k]!) as Vector));
  }

  /** A key with the focus on the picture; returns whether it moved the camera. */
  key(event: KeyboardEvent): boolean {
    if (event.ctrlKey || event.metaKey || event.altKey) return false;
    const camera = this.renderer.getActiveCamera();
    const actions: Record<string, () => void> = {
      ArrowLeft: () => camera.azimuth(8), ArrowRight: () => camera.azimuth(-8),
      ArrowUp: () => camera.elevation(-8), ArrowDown: () => camera.elevation(8),
      "+": () => camera.zoom(1.1), "=": () => camera.zoom(1.1), "-": () => camera.zoom(1 / 1.1),
      r: () => this.reset(), c: () => this.corner(), x: () => this.axis(0, 1), y: () => this.axis(1, -1), z: () => this.axis(2, 1),
      X: () => this.axis(0, -1), Y: () => this.axis(1, 1), Z: () => this.axis(2, -1),
    };
    const by = event.shiftKey ? PANS[event.key] : undefined;
    const action = by ? () => this.pan(...by) : actions[event.key];
    if (!action) return false;
    event.preventDefault();
    action();
    camera.orthogonalizeViewUp();
    this.request();
    return true;
  }
}
