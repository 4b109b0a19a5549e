/** The curve skeleton in the picture: its curves, and the nodes by which they can be dragged. */
import vtkPoints from "@kitware/vtk.js/Common/Core/Points";
import type vtkRenderer from "@kitware/vtk.js/Rendering/Core/Renderer";
import type { Colour } from "./colour";
import { Piece } from "./layer";
import type { Vector } from "../connection/protocol";
import type { Bones } from "./skeleton";

const CURVE: Colour = [0.95, 0.95, 0.6];
const NODE: Colour = [1, 0.6, 0.2];
const HELD: Colour = [1, 1, 1];

/** Draws a skeleton. Its renderer lies over the others, so that no surface hides it. */
export class BonesPicture {
  private readonly points = vtkPoints.newInstance();
  private readonly heldPoint = vtkPoints.newInstance();
  private readonly curves: Piece;
  private readonly nodes: Piece;
  private readonly held: Piece;
  private bones: Bones | null = null;

  constructor(renderer: vtkRenderer) {
    this.curves = new Piece(this.points, renderer);
    this.nodes = new Piece(this.points, renderer);
    this.held = new Piece(this.heldPoint, renderer);
    for (const [piece, colour] of [[this.curves, CURVE], [this.nodes, NODE], [this.held, HELD]] as const) {
      piece.actor.getProperty().setColor(...colour);
      piece.actor.getProperty().setLighting(false);
    }
    this.curves.actor.getProperty().setLineWidth(2);
    this.nodes.actor.getProperty().setPointSize(5);
    this.held.actor.getProperty().setPointSize(12);
    this.show(null);
    this.hold(null);
  }

  /** Draws a skeleton; null takes it away. */
  show(bones: Bones | null): void {
    this.bones = bones;
    for (const piece of [this.curves, this.nodes]) piece.actor.setVisibility(bones !== null);
    this.hold(null);
    if (!bones) return;
    this.points.setData(bones.now, 3);
    this.points.modified();
    this.curves.setLines(bones.segments);
    this.nodes.setPoints(bones.free);
  }

  get shown(): Bones | null {
    return this.bones;
  }

  /** Marks the place that a node is dragged to; null for none. */
  hold(place: Vector | null): void {
    this.held.actor.setVisibility(place !== null);
    this.heldPoint.setData(Float32Array.from(place ?? [0, 0, 0]), 3);
    this.heldPoint.modified();
    this.held.setPoints(Uint32Array.of(0));
  }

  /** Where a node lies in the shape that is now, and where in the reference. */
  node(number: number): { now: Vector; reference: Vector } | null {
    if (!this.bones || !(number >= 0 && 3 * number < this.bones.now.length)) return null;
    const { now, reference } = this.bones;
    const at = (from: Float32Array | Float64Array): Vector => [from[3 * number]!, from[3 * number + 1]!, from[3 * number + 2]!];
    return { now: at(now), reference: at(reference) };
  }
}
