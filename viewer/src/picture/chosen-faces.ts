/** Faces that are chosen one by one, coloured in the picture. */
import vtkPoints from "@kitware/vtk.js/Common/Core/Points";
import type vtkRenderer from "@kitware/vtk.js/Rendering/Core/Renderer";
import type { Colour } from "./colour";
import { Piece } from "./layer";

const CHOSEN: Colour = [1, 0.6, 0.2];

export class ChosenFaces {
  private readonly points = vtkPoints.newInstance();
  private readonly faces: Piece;

  constructor(renderer: vtkRenderer) {
    this.faces = new Piece(this.points, renderer);
    const { actor, mapper } = this.faces;
    actor.getProperty().setColor(...CHOSEN);
    actor.getProperty().setAmbient(0.5);
    actor.getProperty().setDiffuse(0.5);
    mapper.setResolveCoincidentTopologyToPolygonOffset();
    mapper.setRelativeCoincidentTopologyPolygonOffsetParameters(-1.5, -1.5);
    actor.setVisibility(false);
  }

  /** Shows triangles, by the indices of their corners three by three; none takes them away. */
  show(points: Float32Array, corners: Uint32Array): void {
    this.faces.actor.setVisibility(corners.length > 0);
    if (corners.length === 0) return;
    this.points.setData(points, 3);
    this.points.modified();
    this.faces.setTriangles(corners);
  }
}
