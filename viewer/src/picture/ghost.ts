/** The shape that an edit would make, drawn over the picture of the shape that is. */
import vtkPoints from "@kitware/vtk.js/Common/Core/Points";
import type vtkRenderer from "@kitware/vtk.js/Rendering/Core/Renderer";
import type { Colour } from "./colour";
import { Piece } from "./layer";
import { featureEdges } from "./picking";
import type { PreviewSurface } from "../preview/preview";

const SHELL: Colour = [0.45, 0.9, 0.62];
const BROKEN: Colour = [1, 0.25, 0.2];

export class Ghost {
  private readonly points = vtkPoints.newInstance();
  private readonly shell: Piece;
  private readonly edges: Piece;
  private readonly broken: Piece;
  private triangles = new Uint32Array(0);
  private count = 0;
  private anyBroken = false;
  /** The points that are drawn, interleaved; null when nothing is. */
  coordinates: Float32Array | null = null;

  constructor(renderer: vtkRenderer) {
    this.shell = new Piece(this.points, renderer);
    this.edges = new Piece(this.points, renderer);
    this.broken = new Piece(this.points, renderer);
    const shell = this.shell.actor.getProperty();
    shell.setColor(...SHELL);
    shell.setOpacity(0.45);
    shell.setAmbient(0.4);
    shell.setDiffuse(0.6);
    shell.setInterpolationToFlat();
    const edges = this.edges.actor.getProperty();
    edges.setColor(...SHELL);
    edges.setLighting(false);
    edges.setLineWidth(2);
    const broken = this.broken.actor.getProperty();
    broken.setColor(...BROKEN);
    broken.setLighting(false);
    this.broken.mapper.setResolveCoincidentTopologyToPolygonOffset();
    this.broken.mapper.setRelativeCoincidentTopologyPolygonOffsetParameters(-2, -2);
    this.show();
  }

  setSurface({ triangles, triangleFeatures }: PreviewSurface): void {
    this.coordinates = null;
    this.triangles = triangles as Uint32Array<ArrayBuffer>;
    this.count = triangles.reduce((largest, point) => Math.max(largest, point + 1), 0);
    // The cells follow with the first points: vtk.js does not draw cells of points that are not there.
    this.points.setData(new Float32Array(3 * this.count), 3);
    this.shell.setTriangles(triangles);
    this.edges.setLines(featureEdges(triangles, triangleFeatures, this.count));
    this.show();
  }

  /** Takes the points of a shape, and the triangles of it that are broken; null takes the ghost away. */
  setPoints(points: Float32Array | null, broken: Uint32Array = new Uint32Array(0)): void {
    this.coordinates = points !== null && points.length === 3 * this.count ? points : null;
    if (this.coordinates) {
      this.points.setData(this.coordinates, 3);
      this.points.modified();
      if (broken.length > 0 || this.anyBroken) this.broken.setTriangles(corners(this.triangles, broken));
      this.anyBroken = broken.length > 0;
      for (const piece of [this.shell, this.edges, this.broken]) piece.data.modified();
    }
    this.show();
  }

  private show(): void {
    for (const piece of [this.shell, this.edges]) piece.actor.setVisibility(this.coordinates !== null);
    this.broken.actor.setVisibility(this.coordinates !== null && this.anyBroken);
  }
}

function corners(triangles: Uint32Array, chosen: Uint32Array): Uint32Array {
  const result = new Uint32Array(3 * chosen.length);
  chosen.forEach((triangle, i) => result.set(triangles.subarray(3 * triangle, 3 * triangle + 3), 3 * i));
  return result;
}
