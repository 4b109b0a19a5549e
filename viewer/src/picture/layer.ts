/** One view in the picture: its surface or lines, the edges of its features and their highlights. */
import vtkActor from "@kitware/vtk.js/Rendering/Core/Actor";
import vtkMapper from "@kitware/vtk.js/Rendering/Core/Mapper";
import vtkPolyData from "@kitware/vtk.js/Common/DataModel/PolyData";
import vtkPoints from "@kitware/vtk.js/Common/Core/Points";
import vtkCellArray from "@kitware/vtk.js/Common/Core/CellArray";
import type vtkRenderer from "@kitware/vtk.js/Rendering/Core/Renderer";
import type { Colour } from "./colour";
import { Colouring } from "./colouring";
import { clusterer } from "./clusterer";
import type { Clusterer } from "./clusterer";
import { coarsened } from "./clustering";
import type { Clusters } from "./clustering";
import { bounds, featureEdges } from "./picking";
import { drawInstead } from "./surface-node";
import type { CoarseCells } from "./surface-node";
import type { Look } from "../store/looks";
import type { Range } from "./ranges";
import type { DataArray, DataFrame, TopologyFrame, Vector } from "../connection/protocol";
import { TriangleTree } from "./triangle-tree";
import type { Hit } from "./triangle-tree";

export type Highlight = "hover" | "handle" | "fixed";
export const HIGHLIGHT_COLOURS: Record<Highlight, Colour> = {
  hover: [1, 1, 1], handle: [1, 0.6, 0.2], fixed: [0.35, 0.72, 1],
};
const HIGHLIGHT_OPACITY: Record<Highlight, number> = { hover: 0.25, handle: 0.35, fixed: 0.4 };
/** How far each lies above the surface; its outline lies higher. */
const HIGHLIGHT_ORDER: Record<Highlight, number> = { hover: -1.5, handle: -1, fixed: -1 };
const SOLID: Colour = [0.72, 0.76, 0.8];

/** Cells as vtk.js wants them: the number of points before each cell's points. */
function cells(points: Uint32Array, size: number): Uint32Array {
  const result = new Uint32Array((points.length / size) * (size + 1));
  for (let cell = 0, at = 0; cell < points.length; cell += size) {
    result[at++] = size;
    for (let k = 0; k < size; k++) result[at++] = points[cell + k]!;
  }
  return result;
}

/** Whether two lists hold the same numbers. */
function isSame(a: Float32Array, b: Float32Array): boolean {
  if (a.length !== b.length) return false;
  for (let i = 0; i < a.length; i++) if (a[i] !== b[i]) return false;
  return true;
}

export class Piece {
  readonly data = vtkPolyData.newInstance();
  readonly mapper = vtkMapper.newInstance();
  readonly actor = vtkActor.newInstance();
  /** Fewer cells over the same points; null where there are none. */
  private coarse: CoarseCells | null = null;
  private triangles: Uint32Array = new Uint32Array(0);
  private lines: Uint32Array = new Uint32Array(0);

  constructor(points: vtkPoints, renderer: vtkRenderer) {
    this.data.setPoints(points);
    this.mapper.setInputData(this.data);
    this.actor.setMapper(this.mapper);
    this.actor.setPickable(false);
    renderer.addActor(this.actor);
  }

  setTriangles(triangles: Uint32Array): void {
    this.triangles = triangles;
    this.data.setPolys(vtkCellArray.newInstance({ values: cells(triangles, 3) }));
    this.data.modified();
  }

  setPoints(points: Uint32Array): void {
    this.data.setVerts(vtkCellArray.newInstance({ values: cells(points, 1) }));
    this.data.modified();
  }

  setLines(lines: Uint32Array): void {
    this.lines = lines;
    this.data.setLines(vtkCellArray.newInstance({ values: cells(lines, 2) }));
    this.data.modified();
  }

  /** Cells to be drawn in place of the whole where `drawCoarse` says so; null where there are none. */
  setCoarse(coarse: CoarseCells | null): void {
    this.coarse = coarse;
  }

  /** Has its own cells drawn between their representatives instead; null takes that back. */
  coarsen(representatives: Uint32Array | null): void {
    this.coarse = representatives && { triangles: coarsened(this.triangles, 3, representatives), lines: coarsened(this.lines, 2, representatives) };
  }

  drawCoarse(isCoarse: boolean): void {
    drawInstead(this.mapper, isCoarse ? this.coarse : null);
  }
}

interface HighlightPieces { tint: Piece; outline: Piece }

export class Layer {
  topology: TopologyFrame | null = null;
  frame: DataFrame | null = null;
  /** The cycle of the newest values, whatever their topology. */
  cycle = -Infinity;
  /** Coordinates that are drawn now, interleaved. */
  coordinates = new Float32Array(0);
  look: Look;
  private readonly colouring: Colouring;
  private box: { of: Float32Array; bounds: [Vector, Vector] | null } | null = null;
  /** Over the triangles of the topology; made when it is first asked, and brought up to the coordinates that are drawn. */
  private tree: TriangleTree | null = null;
  private treeOf: Float32Array | null = null;
  private readonly points = vtkPoints.newInstance();
  private readonly surface: Piece;
  private readonly edges: Piece;
  private readonly highlights: Partial<Record<Highlight, HighlightPieces>> = {};
  private readonly highlighted: Record<Highlight, string> = { hover: "", handle: "", fixed: "" };
  /** For each point the one in whose place it is drawn, where the view is drawn with fewer triangles; null where it has none to spare, or they are not known yet. */
  private representatives: Uint32Array | null = null;
  private unwant: () => void = () => undefined;

  constructor(readonly name: string, readonly kind: string, look: Look, private readonly renderer: vtkRenderer, private readonly clusters: Pick<Clusterer, "want"> = clusterer) {
    this.look = look;
    this.surface = new Piece(this.points, renderer);
    this.colouring = new Colouring(this.surface.data, this.surface.mapper);
    const property = this.surface.actor.getProperty();
    property.setColor(...SOLID);
    property.setInterpolationToFlat();
    if (kind === "surface") {
      property.setAmbient(0.3);
      property.setDiffuse(0.75);
    } else {
      property.setLighting(false);
    }
    this.edges = new Piece(this.points, renderer);
    this.edges.actor.getProperty().setLighting(false);
    this.raise(this.edges, -2);
  }

  /** The pieces of a highlight, made when it is first wanted: every piece takes its time, also one that is not seen. */
  private highlightOf(kind: Highlight): HighlightPieces {
    const known = this.highlights[kind];
    if (known) return known;
    const tint = new Piece(this.points, this.renderer);
    const outline = new Piece(this.points, this.renderer);
    const order = HIGHLIGHT_ORDER[kind];
    for (const piece of [tint, outline]) {
      piece.actor.getProperty().setColor(...HIGHLIGHT_COLOURS[kind]);
      this.raise(piece, piece === tint ? order : order - 2);
    }
    tint.actor.getProperty().setOpacity(HIGHLIGHT_OPACITY[kind]);
    tint.actor.getProperty().setAmbient(0.5);
    tint.actor.getProperty().setDiffuse(0.5);
    outline.actor.getProperty().setLighting(false);
    return this.highlights[kind] = { tint, outline };
  }

  private raise(piece: Piece, order: number): void {
    piece.mapper.setResolveCoincidentTopologyToPolygonOffset();
    piece.mapper.setRelativeCoincidentTopologyPolygonOffsetParameters(order, order);
    piece.mapper.setRelativeCoincidentTopologyLineOffsetParameters(order, order);
  }

  remove(): void {
    this.unwant();
    for (const piece of this.pieces()) this.renderer.removeActor(piece.actor);
  }

  private pieces(): Piece[] {
    return [this.surface, this.edges, ...Object.values(this.highlights).flatMap(({ tint, outline }) => [tint, outline])];
  }

  setTopology(topology: TopologyFrame): void {
    this.topology = topology;
    this.tree = null;
    this.frame = null;
    this.unwant();
    this.takeClusters(null);
    this.colouring.take(null, -1, 0);
    for (const key of Object.keys(this.highlighted) as Highlight[]) this.highlighted[key] = "";
  }

  /** The first triangle that is drawn and that a ray meets. */
  firstHit(origin: Vector, direction: Vector): Hit | null {
    const { topology, coordinates } = this;
    if (!topology || coordinates.length !== topology.points * 3) return null;
    if (!this.tree) this.tree = new TriangleTree(topology.triangles, coordinates);
    else if (this.treeOf !== coordinates) this.tree.refit(coordinates);
    this.treeOf = coordinates;
    return this.tree.firstHit(origin, direction);
  }

  /** Takes the newest values. Returns why it cannot, if it cannot. */
  setData(frame: DataFrame): string | null {
    const topology = this.topology;
    if (!topology || topology.topology !== frame.topology) return null;
    const fresh = this.frame === null;
    if (frame.points.length !== topology.points * 3) {
      return `view ${this.name}: ${frame.points.length / 3} points, its topology has ${topology.points}`;
    }
    const triangles = topology.triangles.length / 3;
    const elements = triangles + topology.lines.length / 2;
    for (const field of frame.fields) {
      const expected = field.association === "vertex" ? topology.points : elements;
      if (field.values.length !== expected * field.components) {
        return `view ${this.name}: field ${field.name} has ${field.values.length / field.components} values, expected ${expected}`;
      }
    }
    this.frame = frame;
    this.cycle = frame.cycle;
    // Of a mesh that rests there is one list of coordinates: what was made of it stays as it is, here and in the memory of the graphics card.
    if (isSame(frame.points, this.coordinates)) frame.points = this.coordinates;
    else {
      this.coordinates = frame.points as Float32Array<ArrayBuffer>;
      this.points.setData(frame.points, 3);
      this.points.modified();
    }
    if (fresh) {
      this.setCells(topology);
      this.unwant = this.clusters.want(topology, frame.points, (clusters) => this.takeClusters(clusters));
    }
    return null;
  }

  private setCells(topology: TopologyFrame): void {
    this.surface.setTriangles(topology.triangles);
    this.surface.setLines(topology.lines);
    this.edges.setLines(topology.triangleFeatures
      ? featureEdges(topology.triangles, topology.triangleFeatures, topology.points) : new Uint32Array(0));
  }

  /** Takes the representatives; null where the view is drawn whole. What lies on the surface goes with it. */
  private takeClusters(clusters: Clusters | null): void {
    this.representatives = clusters?.representatives ?? null;
    this.surface.setCoarse(clusters && { triangles: clusters.triangles });
    for (const piece of this.pieces()) if (piece !== this.surface) piece.coarsen(this.representatives);
  }

  /** The box around what is drawn. */
  get bounds(): [Vector, Vector] | null {
    if (this.box?.of !== this.coordinates) this.box = { of: this.coordinates, bounds: bounds(this.coordinates) };
    return this.box.bounds;
  }

  /** Takes the scalars of the field that colours; returns their range, null when this view does not carry the field. */
  takeScalars(): Range | null {
    const { field: name, component } = this.look;
    const field = this.frame?.fields.find((candidate) => candidate.name === name) ?? null;
    return this.colouring.take(field, component, (this.topology?.triangles.length ?? 0) / 3);
  }

  /** Lets the colours of its map stand for a range. */
  paint(range: Range): void {
    this.colouring.paint(range, this.look);
  }

  /** The field that colours it now. */
  get coloured(): DataArray | null {
    return this.colouring.field;
  }

  /** Whether some of the values that colour it are no numbers, and grey. */
  get hasGaps(): boolean {
    return this.colouring.hasGaps;
  }

  highlight(kind: Highlight, names: readonly string[], features: readonly string[]): void {
    const topology = this.topology;
    const key = names.join("\u0000");
    if (!topology?.triangleFeatures || !this.frame || this.highlighted[kind] === key) return;
    this.highlighted[kind] = key;
    const wanted = new Set(names.map((name) => features.indexOf(name)));
    const picked: number[] = [];
    for (let triangle = 0; triangle < topology.triangleFeatures.length; triangle++) {
      if (wanted.has(topology.triangleFeatures[triangle]!)) picked.push(topology.triangles[3 * triangle]!, topology.triangles[3 * triangle + 1]!, topology.triangles[3 * triangle + 2]!);
    }
    const triangles = Uint32Array.from(picked);
    const { tint, outline } = this.highlightOf(kind);
    tint.setTriangles(triangles);
    outline.setLines(featureEdges(triangles, new Uint32Array(triangles.length / 3), topology.points));
    for (const piece of [tint, outline]) piece.coarsen(this.representatives);
  }

  /** The colours of lines that are not a field's: dark lines on a light ground. */
  setTheme(edge: Colour): void {
    this.edges.actor.getProperty().setColor(...edge);
    this.surface.actor.getProperty().setEdgeColor(...edge);
  }

  /** Brings what is shown in line with the look; a large view has fewer triangles where the picture is to be coarse. */
  show(isCoarse = false): void {
    for (const piece of this.pieces()) piece.drawCoarse(isCoarse);
    const { visible, opacity, edges } = this.look;
    const drawn = visible && this.frame !== null;
    const property = this.surface.actor.getProperty();
    this.surface.actor.setVisibility(drawn && opacity > 0);
    property.setOpacity(opacity);
    property.setEdgeVisibility(edges === "mesh");
    this.edges.actor.setVisibility(drawn && edges !== "none" && this.topology?.triangleFeatures !== null);
    for (const [kind, pieces] of Object.entries(this.highlights)) {
      for (const piece of [pieces.tint, pieces.outline]) piece.actor.setVisibility(drawn && this.highlighted[kind as Highlight] !== "");
    }
  }
}
