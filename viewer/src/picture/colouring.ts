/** How the surface of a view is coloured: the values of a field, and the map between the ends of whose range they lie. */
import vtkColorTransferFunction from "@kitware/vtk.js/Rendering/Core/ColorTransferFunction";
import type vtkMapper from "@kitware/vtk.js/Rendering/Core/Mapper";
import vtkDataArray from "@kitware/vtk.js/Common/Core/DataArray";
import type vtkPolyData from "@kitware/vtk.js/Common/DataModel/PolyData";
import type { DataArray } from "../connection/protocol";
import type { Look } from "../store/looks";
import { NO_NUMBER, colourMap, extremes, mapped, scalars } from "./colour";
import type { Range } from "./ranges";

/** vtk.js lets no coordinate be farther from its texture. */
const FARTHEST = 1000;

/** What its types leave out: the texture coordinates that it has made of values, and the colours between the ends of a range. */
interface Mapped { getColorCoordinates(): vtkDataArray | null; getNumberOfColorsInRange(): number }

/** The values that colour: of which field they are, and what vtk.js counts first among its cells. */
interface Taken { field: DataArray; component: number; values: Float64Array; range: Range | null; hasGaps: boolean }

export class Colouring {
  /** The colours from 0 to 1. The values are brought between these two: vtk.js makes a map anew whenever its ends change, and its shaders with it. */
  readonly table = vtkColorTransferFunction.newInstance();
  private map = "";
  private taken: Taken | null = null;
  private painted: { taken: Taken; low: number; high: number; logarithmic: boolean } | null = null;
  /** Where the scalars of vectors are written, those of each frame over those of the one before. */
  private room = new Float64Array(0);
  private drawn: vtkDataArray | null = null;

  constructor(private readonly data: vtkPolyData, private readonly mapper: vtkMapper) {
    this.table.set({ nanColor: [NO_NUMBER, NO_NUMBER, NO_NUMBER, 1] });
    mapper.setLookupTable(this.table);
    mapper.setUseLookupTableScalarRange(true);
    mapper.setInterpolateScalarsBeforeMapping(true);
    mapper.setScalarVisibility(false);
  }

  /** The field that colours; null for none. */
  get field(): DataArray | null {
    return this.taken?.field ?? null;
  }

  /** Whether some value of the field is no number, and grey. */
  get hasGaps(): boolean {
    return this.taken?.hasGaps ?? false;
  }

  /** Takes a field, or none, of a view that has so many triangles; returns the range of its values, null where there are none. */
  take(field: DataArray | null, component: number, triangles: number): Range | null {
    if (!field) this.taken = null;
    else if (this.taken?.field !== field || this.taken.component !== component) {
      const values = scalars(field, component, this.room);
      if (values !== field.values) this.room = values as Float64Array<ArrayBuffer>;
      // vtk.js numbers the lines of a view before its triangles.
      const isReordered = field.association === "element" && triangles > 0 && triangles < values.length;
      this.taken = { field, component, values: isReordered ? linesFirst(values, triangles) : values, ...extremes(values) };
    }
    this.mapper.setScalarVisibility(this.taken !== null);
    return this.taken?.range ?? null;
  }

  /** Lets the colours of a map stand for a range. */
  paint([low, high]: Range, { map, range: { logarithmic } }: Pick<Look, "map" | "range">): void {
    const { taken, painted } = this;
    if (!taken) return;
    this.setMap(map);
    const { values, field } = taken;
    if (painted?.taken === taken && painted.low === low && painted.high === high && painted.logarithmic === logarithmic) return;
    this.painted = { taken, low, high, logarithmic };
    const ofPoints = field.association === "vertex";
    if (ofPoints && this.drawn?.getNumberOfTuples() === values.length && this.data.getPointData().getScalars() === this.drawn) {
      mapped(values, [low, high], logarithmic, this.drawn.getData() as Float32Array);
      return this.recolour(this.drawn.getData() as Float32Array);
    }
    this.drawn = vtkDataArray.newInstance({ name: field.name, numberOfComponents: 1, values: mapped(values, [low, high], logarithmic) as Float32Array<ArrayBuffer> });
    this.data.getPointData().setScalars(ofPoints ? this.drawn : (null as never));
    this.data.getCellData().setScalars(ofPoints ? (null as never) : this.drawn);
    if (ofPoints) this.mapper.setScalarModeToUsePointData();
    else this.mapper.setScalarModeToUseCellData();
    this.data.modified();
  }

  private setMap(name: string): void {
    if (this.map === name) return;
    this.map = name;
    const { stops } = colourMap(name);
    this.table.setNodes(stops.map(([r, g, b], i) => ({ x: i / (stops.length - 1), r, g, b, midpoint: 0.5, sharpness: 0 })));
  }

  /**
   * Brings the texture coordinates that vtk.js has made of values up to other values, in place: it makes buffers, textures and shaders
   * anew for an array that is another one. They are what it would make itself (`ScalarColoringHelper`, as a test says); where it has made
   * none yet it takes the values as they are now.
   */
  private recolour(values: Float32Array): void {
    const mapper = this.mapper as unknown as Mapped;
    const made = mapper.getColorCoordinates();
    const coordinates = made?.getData() as Float32Array | undefined;
    if (!made || coordinates?.length !== 2 * values.length) return;
    // One texel each for what is below, above and no number.
    const colours = mapper.getNumberOfColorsInRange();
    const texel = 1 / (colours - 1), part = 1 / (1 + 3 * texel);
    for (let i = 0; i < values.length; i++) {
      const value = values[i]!;
      const isNumber = !Number.isNaN(value);
      coordinates[2 * i] = isNumber ? Math.max(-FARTHEST, Math.min(FARTHEST, (value + 1.5 * texel) * part)) : (colours + 1.5) / (colours + 2);
      coordinates[2 * i + 1] = isNumber ? 0.49 : 0.75;
    }
    made.modified();
  }
}

function linesFirst(values: Float64Array, triangles: number): Float64Array {
  const result = new Float64Array(values.length);
  result.set(values.subarray(triangles));
  result.set(values.subarray(0, triangles), values.length - triangles);
  return result;
}
