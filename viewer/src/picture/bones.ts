/** The curves of a skeleton in the picture. */
import vtkPoints from "@kitware/vtk.js/Common/Core/Points";
import type vtkRenderer from "@kitware/vtk.js/Rendering/Core/Renderer";
import type { Colour } from "./colour";
import { Piece } from "./layer";
import type { Bones } from "./skeleton";

const CURVE: Colour = [0.95, 0.95, 0.6];

/** Draws a skeleton. Its renderer lies over the others, so that no surface hides it. */
export class BonesPicture {
  private readonly points = vtkPoints.newInstance();
  private readonly curves: Piece;
  private bones: Bones | null = null;

  constructor(renderer: vtkRenderer) {
    this.curves = new Piece(this.points, renderer);
    this.curves.actor.getProperty().setColor(...CURVE);
    this.curves.actor.getProperty().setLighting(false);
    this.curves.actor.getProperty().setLineWidth(2);
    this.show(null);
  }

  /** Draws a skeleton, where there is one as it is previewed; null takes it away. */
  show(bones: Bones | null): void {
    const isOther = bones?.curves !== this.bones?.curves;
    this.bones = bones;
    this.curves.actor.setVisibility(bones !== null);
    if (!bones) return;
    this.points.setData(bones.preview ?? bones.now, 3);
    this.points.modified();
    if (isOther) this.curves.setLines(bones.segments);
    this.curves.data.modified();
  }

  get shown(): Bones | null {
    return this.bones;
  }
}
