import { beforeEach, describe, expect, it } from "vitest";
import vtkRenderer from "@kitware/vtk.js/Rendering/Core/Renderer";
import { Ghost } from "../../src/picture/ghost";
import type { Piece } from "../../src/picture/layer";

/** Two triangles of two features over a square. */
const SURFACE = { triangles: Uint32Array.of(0, 1, 2, 0, 2, 3), triangleFeatures: Uint32Array.of(0, 1), features: ["wall", "throat"] };
const POINTS = Float32Array.of(0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0);

describe("the ghost of a shape", () => {
  let ghost: Ghost;
  let parts: Record<"shell" | "edges" | "broken", Piece>;
  const seen = (): boolean[] => [parts.shell, parts.edges, parts.broken].map(({ actor }) => actor.getVisibility());
  const cells = (piece: Piece): number[] => [...piece.data.getPolys().getData()];
  beforeEach(() => {
    ghost = new Ghost(vtkRenderer.newInstance());
    parts = ghost as unknown as typeof parts;
    ghost.setSurface(SURFACE);
  });

  it("is seen once it has points, and no more without", () => {
    expect(seen()).toEqual([false, false, false]);
    ghost.setPoints(POINTS);
    expect([seen(), ghost.coordinates, [...parts.shell.data.getPoints().getData()]]).toEqual([[true, true, false], POINTS, [...POINTS]]);
    // The border of a feature is a line, and so is that of the surface.
    expect(parts.edges.data.getLines().getNumberOfCells()).toBe(5);
    ghost.setPoints(null);
    expect([seen(), ghost.coordinates]).toEqual([[false, false, false], null]);
  });

  it("has its broken triangles in a colour of their own, over the others, until they are sound", () => {
    ghost.setPoints(POINTS, Uint32Array.of(1));
    expect([seen(), cells(parts.broken)]).toEqual([[true, true, true], [3, 0, 2, 3]]);
    const [red, green, blue] = parts.broken.actor.getProperty().getColor();
    expect(red > 2 * Math.max(green, blue)).toBe(true);
    const mapper = parts.broken.mapper as unknown as { getRelativeCoincidentTopologyPolygonOffsetParameters(): { factor: number } };
    expect(mapper.getRelativeCoincidentTopologyPolygonOffsetParameters().factor).toBeLessThan(0);
    ghost.setPoints(POINTS, Uint32Array.of(0));
    expect(cells(parts.broken)).toEqual([3, 0, 1, 2]);
    ghost.setPoints(POINTS);
    expect(seen()).toEqual([true, true, false]);
  });

  it("is not drawn with points of another surface", () => {
    ghost.setPoints(POINTS);
    ghost.setPoints(new Float32Array(9), Uint32Array.of(0));
    expect(seen()).toEqual([false, false, false]);
    ghost.setPoints(POINTS);
    ghost.setSurface({ ...SURFACE, triangles: Uint32Array.of(0, 1, 2), triangleFeatures: Uint32Array.of(0) });
    expect([seen(), ghost.coordinates]).toEqual([[false, false, false], null]);
  });
});
