/** What is seen at a place of the page, and where on the page a point is seen. */
import type vtkRenderer from "@kitware/vtk.js/Rendering/Core/Renderer";
import type vtkOpenGLRenderWindow from "@kitware/vtk.js/Rendering/OpenGL/RenderWindow";
import type { Vector } from "../connection/protocol";
import { Projection } from "../handles/projection";
import type { Layer } from "./layer";
import { cornersOf, probeNear, readProbe, weights } from "./probe";
import type { Probe, ProbeReading } from "./probe";

export class Places {
  /** `container` is what the picture fills on the page; `features` are the names of those that the triangles of the layers tell by number. */
  constructor(
    private readonly container: HTMLElement, private readonly canvas: vtkOpenGLRenderWindow, private readonly renderer: vtkRenderer,
    private readonly layers: ReadonlyMap<string, Layer>, private readonly features: () => readonly string[],
  ) {}

  /** The place of the page at which a point is drawn. */
  onPage(point: Vector): [number, number] {
    const box = this.container.getBoundingClientRect();
    const [width, height] = this.canvas.getSize();
    const place = this.canvas.worldToDisplay(...point, this.renderer);
    return [box.left + (place[0] / width) * box.width, box.top + (1 - place[1] / height) * box.height];
  }

  /** How the picture is seen now, in CSS pixels from its upper left corner. */
  projection(): Projection {
    const { clientWidth, clientHeight } = this.container;
    const matrix = this.renderer.getActiveCamera().getCompositeProjectionMatrix(clientWidth / Math.max(1, clientHeight), -1, 1);
    return new Projection(matrix, clientWidth, clientHeight);
  }

  /** A place of the page on the canvas: x and y from its lower left corner, in its own pixels. */
  private onCanvas(clientX: number, clientY: number): [number, number] {
    const box = this.container.getBoundingClientRect();
    const [width, height] = this.canvas.getSize();
    return [((clientX - box.left) / box.width) * width, (1 - (clientY - box.top) / box.height) * height];
  }

  /** The line through a place of the page, from the nearest depth of the picture to the farthest. */
  private ray(clientX: number, clientY: number): { origin: Vector; direction: Vector } {
    const [x, y] = this.onCanvas(clientX, clientY);
    const near = this.canvas.displayToWorld(x, y, 0, this.renderer);
    const far = this.canvas.displayToWorld(x, y, 1, this.renderer);
    return { origin: near, direction: [far[0] - near[0], far[1] - near[1], far[2] - near[2]] };
  }

  /** The nearest triangle under a place of the page of the layers that are wanted. */
  private hit(clientX: number, clientY: number, wanted: (layer: Layer) => boolean): { layer: Layer; triangle: number; point: Vector } | null {
    const { origin, direction } = this.ray(clientX, clientY);
    let nearest: { layer: Layer; triangle: number; distance: number } | null = null;
    for (const layer of this.layers.values()) {
      if (!layer.look.visible || !wanted(layer)) continue;
      const hit = layer.firstHit(origin, direction);
      if (hit && (!nearest || hit.distance < nearest.distance)) nearest = { layer, ...hit };
    }
    if (!nearest) return null;
    const { layer, triangle, distance } = nearest;
    return { layer, triangle, point: [0, 1, 2].map((axis) => origin[axis]! + distance * direction[axis]!) as Vector };
  }

  /** The feature under a place of the page; null when there is none. */
  featureAt(clientX: number, clientY: number): string | null {
    return this.pick(clientX, clientY)?.feature ?? null;
  }

  /** The feature under a place of the page, and where it is met; null when there is none. */
  pick(clientX: number, clientY: number): { feature: string; point: Vector } | null {
    const hit = this.hit(clientX, clientY, (layer) => layer.topology?.triangleFeatures != null);
    const feature = hit && this.features()[hit.layer.topology?.triangleFeatures?.[hit.triangle] ?? -1];
    return hit && feature !== null && feature !== undefined ? { feature, point: hit.point } : null;
  }

  /** The place under a place of the page: of what carries colours, where anything does. */
  probe(clientX: number, clientY: number): Probe | null {
    const hit = this.hit(clientX, clientY, (layer) => layer.coloured !== null) ?? this.hit(clientX, clientY, () => true);
    const { topology, frame, name } = hit?.layer ?? {};
    // Values of a new topology may be on their way: what is drawn until then is in other triangles.
    const corners = hit && topology && frame && cornersOf(hit.triangle, topology, frame.points);
    return corners ? { view: name!, topology: topology.topology, triangle: hit.triangle, weights: weights(hit.point, corners.places) } : null;
  }

  /** The topology that a view is drawn with; null as long as it has no values, undefined where there is no such view. */
  topologyOf(view: string): string | null | undefined {
    const layer = this.layers.get(view);
    return layer && (layer.frame ? layer.topology?.topology ?? null : null);
  }

  /** The place of a view that is nearest to a point; null where it has none near it. */
  near(view: string, point: Vector): Probe | null {
    const layer = this.layers.get(view);
    return layer?.topology && layer.frame ? probeNear(view, point, layer.topology, layer.frame.points) : null;
  }

  /** What a view has at a place now; null where the view is no more, or has other triangles. */
  read(probe: Probe): ProbeReading | null {
    const layer = this.layers.get(probe.view);
    return layer?.topology && layer.frame ? readProbe(probe, layer.topology, layer.frame, layer.look) : null;
  }

  /** A place of the page at which this feature is seen and would be picked, among those that are free; null when nothing of it is. */
  featurePlace(name: string, isFree: (x: number, y: number) => boolean = () => true): [number, number] | null {
    const number = this.features().indexOf(name);
    for (const { topology, coordinates } of this.layers.values()) {
      if (!topology?.triangleFeatures || coordinates.length !== topology.points * 3) continue;
      const own = [...topology.triangleFeatures.keys()].filter((triangle) => topology.triangleFeatures?.[triangle] === number);
      const stride = Math.max(1, Math.floor(own.length / 200));
      for (let i = Math.floor(stride / 2); i < own.length; i += stride) {
        const corner = (k: number, axis: number): number => coordinates[3 * topology.triangles[3 * own[i]! + k]! + axis]!;
        const middle = [0, 1, 2].map((axis) => (corner(0, axis) + corner(1, axis) + corner(2, axis)) / 3);
        const [x, y] = this.onPage(middle as Vector);
        if (isFree(x, y) && this.featureAt(x, y) === name && document.elementFromPoint(x, y)?.closest("#scene")) return [x, y];
      }
    }
    return null;
  }
}
