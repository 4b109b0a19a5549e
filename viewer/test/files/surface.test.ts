import { describe, expect, it } from "vitest";
import { displacements, stl, vtp } from "../../src/files/surface";

const points = Float32Array.from([0, 0, 0, 2, 0, 0, 0, 3, 0, 0, 0, 1]);
const triangles = Uint32Array.from([0, 1, 2, 0, 3, 1]);

describe("a surface in a file", () => {
  it("as STL has its triangles, their normals outward by the right hand", () => {
    const buffer = stl(points, triangles);
    const view = new DataView(buffer);
    expect(buffer.byteLength).toBe(84 + 2 * 50);
    expect(view.getUint32(80, true)).toBe(2);
    const floats = (at: number, count: number): number[] => Array.from({ length: count }, (_, i) => view.getFloat32(at + 4 * i, true));
    expect(floats(84, 12)).toEqual([0, 0, 1, 0, 0, 0, 2, 0, 0, 0, 3, 0]);
    expect(floats(134, 3)).toEqual([0, 1, 0]);
  });

  it("as displacements leaves out what rounding alone has moved", () => {
    expect(displacements([0.1, 0, 0], Float32Array.from([0.1, 0.5, 0]))).toBe("x,y,z,dx,dy,dz\n0.1,0,0,0,0.5,0\n");
  });

  it("as VTP counts lines before polygons, and names what a name must not hold", () => {
    const text = vtp({ triangles, lines: Uint32Array.from([0, 1]) }, {
      points, time: 0.5, fields: [{ name: "a<b", association: "element", components: 1, values: Float64Array.from([1, 2, 3]) }, { name: "p", association: "vertex", components: 1, values: Float64Array.from([1, 2, 3, NaN]) }],
    });
    const document = text.replaceAll("\n", "");
    expect(document).toContain('NumberOfPoints="4" NumberOfLines="1" NumberOfPolys="2"');
    expect(document).toContain('Name="a&lt;b" NumberOfComponents="1" format="ascii">3 1 2<');
    expect(document).toContain(">1 2 3 NaN<");
    expect(document).toContain(">0 1 2 0 3 1<");
    expect(document).toContain(">3 6<");
  });
});
