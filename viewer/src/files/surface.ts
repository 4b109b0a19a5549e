/** Surfaces and what they carry, in the formats of other programs. */
import type { DataFrame, TopologyFrame } from "../connection/protocol";

/** A surface as binary STL, its normals those of the right hand. */
export function stl(points: ArrayLike<number>, triangles: ArrayLike<number>): ArrayBuffer {
  const count = triangles.length / 3;
  const buffer = new ArrayBuffer(84 + 50 * count);
  const view = new DataView(buffer);
  view.setUint32(80, count, true);
  for (let t = 0; t < count; t++) {
    const corners = [0, 1, 2].map((corner) => [0, 1, 2].map((k) => points[3 * triangles[3 * t + corner]! + k]!));
    const [u, v] = [1, 2].map((corner) => [0, 1, 2].map((k) => corners[corner]![k]! - corners[0]![k]!)) as [number[], number[]];
    const normal = [0, 1, 2].map((k) => u[(k + 1) % 3]! * v[(k + 2) % 3]! - u[(k + 2) % 3]! * v[(k + 1) % 3]!);
    const length = Math.hypot(...normal) || 1;
    let at = 84 + 50 * t;
    for (const value of [...normal.map((part) => part / length), ...corners.flat()]) {
      view.setFloat32(at, value, true);
      at += 4;
    }
  }
  return buffer;
}

/** How far each vertex of the surface has gone from the reference, as comma-separated values. */
export function displacements(reference: ArrayLike<number>, points: ArrayLike<number>): string {
  const lines = ["x,y,z,dx,dy,dz"];
  for (let i = 0; i < reference.length; i += 3) {
    const at = [0, 1, 2].map((k) => reference[i + k]!);
    // The shape has the digits of 32 bits: what is less than those is none.
    const by = at.map((part, k) => { const way = points[i + k]! - part; return Math.abs(way) <= 2e-7 * Math.abs(part) ? 0 : Number(way.toPrecision(7)); });
    lines.push([...at, ...by].join(","));
  }
  return `${lines.join("\n")}\n`;
}

const list = (values: ArrayLike<number>): string => Array.prototype.map.call(values, (value: number) => (Number.isFinite(value) ? String(Number(value.toPrecision(8))) : "NaN")).join(" ");
const escaped = (text: string): string => text.replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll('"', "&quot;");

/** A view as VTK's XML polygons: its triangles and lines with all fields, for ParaView and others. */
export function vtp({ triangles, lines }: Pick<TopologyFrame, "triangles" | "lines">, { points, fields, time }: Pick<DataFrame, "points" | "fields" | "time">): string {
  const cells = (name: string, corners: Uint32Array, size: number): string => `<${name}><DataArray type="UInt32" Name="connectivity" format="ascii">${list(corners)}</DataArray>`
    + `<DataArray type="UInt32" Name="offsets" format="ascii">${list(Array.from({ length: corners.length / size }, (_, i) => size * (i + 1)))}</DataArray></${name}>\n`;
  const count = triangles.length / 3;
  const array = ({ name, components, values, association }: DataFrame["fields"][number]): string => {
    // VTK counts the lines before the polygons, a frame the other way round.
    const ordered = association === "vertex" ? values : [...values.subarray(count * components), ...values.subarray(0, count * components)];
    return `<DataArray type="Float64" Name="${escaped(name)}" NumberOfComponents="${components}" format="ascii">${list(ordered)}</DataArray>\n`;
  };
  const of = (association: "vertex" | "element"): string => fields.filter((field) => field.association === association).map(array).join("");
  return `<?xml version="1.0"?>\n<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian">\n<PolyData>\n`
    + `<FieldData><DataArray type="Float64" Name="TimeValue" NumberOfTuples="1" format="ascii">${time}</DataArray></FieldData>\n`
    + `<Piece NumberOfPoints="${points.length / 3}" NumberOfLines="${lines.length / 2}" NumberOfPolys="${count}">\n`
    + `<Points><DataArray type="Float32" NumberOfComponents="3" format="ascii">${list(points)}</DataArray></Points>\n`
    + cells("Lines", lines, 2) + cells("Polys", triangles, 3)
    + `<PointData>${of("vertex")}</PointData>\n<CellData>${of("element")}</CellData>\n</Piece>\n</PolyData>\n</VTKFile>\n`;
}
