/**
 * What draws the surfaces: vtk.js's own node, which however writes colours that change into the buffer that is there. vtk.js packs all
 * points anew for them, counts the corners of all cells, makes the texture and puts its shaders together to find that they are the same.
 *
 * It draws other cells over the points that are in its buffers, too, where it is told to: fewer ones, while the picture moves.
 */
import macro from "@kitware/vtk.js/macros";
import vtkOpenGLBufferObject from "@kitware/vtk.js/Rendering/OpenGL/BufferObject";
import { ObjectType } from "@kitware/vtk.js/Rendering/OpenGL/BufferObject/Constants";
import vtkOpenGLCellArrayBufferObject from "@kitware/vtk.js/Rendering/OpenGL/CellArrayBufferObject";
import vtkOpenGLPolyDataMapper from "@kitware/vtk.js/Rendering/OpenGL/PolyDataMapper";
import { registerOverride } from "@kitware/vtk.js/Rendering/OpenGL/ViewNodeFactory";

interface Coordinates { getData(): Float32Array; getMTime(): number }

/** A buffer of points with their texture coordinates, of which those can be written anew. `upload` takes what is packed. */
export interface PointBuffer {
  upload(packed: Float32Array, type: number): boolean;
  /** Writes two texture coordinates of each point; nothing where the buffer is not one of points with these. */
  recolour(coordinates: Float32Array): void;
}
interface BufferModel { indexed: boolean; blockSize: number; tCoordOffset: number; tCoordComponents: number }

/** What else can be drawn of a buffer: a list of its points, triangle by triangle or line by line. */
export interface CoarseBuffer {
  /** Has a list drawn in place of the buffer's own; null has its own drawn again. */
  draw(indices: Uint32Array | null): void;
  getIndexBO(): unknown;
  getIndexElementType(): unknown;
  getIndexed(): boolean;
  getElementCount(): number;
  releaseGraphicsResources(): void;
}
interface CoarseModel { elementCount: number; context: WebGL2RenderingContext; _openGLRenderWindow: unknown }
/** The part of vtk.js's buffer of indices that is needed. */
export interface IndexBuffer { setOpenGLRenderWindow(window: unknown): void; upload(data: Uint32Array, type: ObjectType): boolean; releaseGraphicsResources(): void }

/** Lets a buffer draw other lists of its points than its own; one stays uploaded as long as it is the same. */
export function drawCoarsely(buffer: CoarseBuffer, model: CoarseModel, make: () => IndexBuffer): void {
  const { getIndexBO, getIndexElementType, getIndexed, getElementCount, releaseGraphicsResources } = buffer;
  let drawn: Uint32Array | null = null, uploaded: Uint32Array | null = null, made: IndexBuffer | null = null;
  buffer.draw = (indices) => {
    drawn = model.elementCount > 0 ? indices : null;
    if (!drawn || drawn === uploaded) return;
    made ??= make();
    made.setOpenGLRenderWindow(model._openGLRenderWindow);
    made.upload(drawn, ObjectType.ELEMENT_ARRAY_BUFFER);
    uploaded = drawn;
  };
  buffer.getIndexBO = () => (drawn ? made : getIndexBO());
  buffer.getIndexElementType = () => (drawn ? model.context.UNSIGNED_INT : getIndexElementType());
  buffer.getIndexed = () => drawn !== null || getIndexed();
  buffer.getElementCount = () => drawn?.length ?? getElementCount();
  buffer.releaseGraphicsResources = () => {
    releaseGraphicsResources();
    made?.releaseGraphicsResources();
    drawn = uploaded = null;
  };
}

/** Lets a buffer that uploads what is packed keep it, so that its texture coordinates can be written anew. */
export function keepPacked(buffer: PointBuffer, model: BufferModel): void {
  const { upload } = buffer;
  let kept: { packed: Float32Array; type: number } | null = null;
  buffer.upload = (packed, type) => {
    kept = model.tCoordOffset > 0 ? { packed, type } : null;
    return upload(packed, type);
  };
  buffer.recolour = (coordinates) => {
    const { indexed, blockSize, tCoordOffset, tCoordComponents } = model;
    if (!kept || !indexed || tCoordComponents !== 2 || kept.packed.length * 2 !== coordinates.length * blockSize) return;
    const { packed, type } = kept;
    for (let from = 0, to = tCoordOffset / 4; from < coordinates.length; from += 2, to += blockSize) {
      packed[to] = coordinates[from]!;
      packed[to + 1] = coordinates[from + 1]!;
    }
    upload(packed, type);
  };
}

type Buffer = PointBuffer & CoarseBuffer;

function extendBuffer(publicAPI: Buffer, model: BufferModel & CoarseModel, initialValues: object = {}): void {
  vtkOpenGLCellArrayBufferObject.extend(publicAPI, model, initialValues);
  keepPacked(publicAPI, model);
  drawCoarsely(publicAPI, model, () => vtkOpenGLBufferObject.newInstance());
}
const makeBuffer = macro.newInstance(extendBuffer as never, "tombolo.PointBuffer") as () => Buffer;

/** Cells in place of all triangles, or all lines, of a surface; those that are left out are drawn as they are. */
export interface CoarseCells { triangles?: Uint32Array; lines?: Uint32Array }
const coarse = new WeakMap<object, CoarseCells>();

/** Has a mapper's surface drawn with other cells over its points; null has it drawn whole again. */
export function drawInstead(mapper: object, cells: CoarseCells | null): void {
  if (cells) coarse.set(mapper, cells);
  else coarse.delete(mapper);
}

/** The cells that a mapper's surface is drawn with now; null where it is drawn whole. */
export const insteadOf = (mapper: object): CoarseCells | null => coarse.get(mapper) ?? null;

/** The three sides of triangles, as lines. */
export function sidesOf(triangles: Uint32Array): Uint32Array {
  const result = new Uint32Array(2 * triangles.length);
  for (let at = 0; at < triangles.length; at++) {
    result[2 * at] = triangles[at]!;
    result[2 * at + 1] = triangles[at % 3 === 2 ? at - 2 : at + 1]!;
  }
  return result;
}

/**
 * Triangles between points as triangles between corners: where each triangle has a colour, vtk.js has its corners one after the other,
 * and none is shared. The colours of a corner are those of the first triangle that has it. `cells` are vtk.js's own, with sizes between.
 */
export function cornersOf(triangles: Uint32Array, cells: ArrayLike<number>): Uint32Array {
  const highest = triangles.reduce((most, point) => Math.max(most, point), 0);
  // The number after each point's first corner; 0 for none.
  const after = new Uint32Array(highest + 1);
  for (let at = 0, corner = 1; at < cells.length; at += 4) {
    for (let k = 1; k <= 3; k++, corner++) {
      const point = cells[at + k]!;
      if (after[point] === 0) after[point] = corner;
    }
  }
  return triangles.map((point) => Math.max(0, after[point]! - 1));
}

/** What vtk.js draws one after the other. */
const LINES = 1, TRIANGLES = 2, SIDES = 4;

interface Node { updateBufferObjects(renderer: unknown, actor: unknown): void }
interface NodeModel {
  primitives: { getCABO(): Buffer; setCABO(buffer: Buffer): void }[];
  VBOBuildTime: { getMTime(): number };
  renderable: { getColorCoordinates(): Coordinates | null };
  currentInput: { getPolys(): { getData(): ArrayLike<number> } };
}

function extendNode(publicAPI: Node, model: NodeModel, initialValues: object = {}): void {
  vtkOpenGLPolyDataMapper.extend(publicAPI, model, initialValues);
  for (const primitive of model.primitives) primitive.setCABO(makeBuffer());
  const { updateBufferObjects } = publicAPI;
  let coloured = 0;
  let made: { of: Uint32Array; over: ArrayLike<number>; sides?: Uint32Array; corners?: Uint32Array } | null = null;
  /** Draws what was wanted in place of the whole. */
  const drawWanted = (): void => {
    const wanted = insteadOf(model.renderable);
    if (!wanted) return;
    const { triangles, lines } = wanted;
    const buffer = (primitive: number): Buffer => model.primitives[primitive]!.getCABO();
    if (lines) buffer(LINES).draw(lines);
    if (!triangles) return;
    const over = model.currentInput.getPolys().getData();
    if (made?.of !== triangles || made.over !== over) made = { of: triangles, over };
    buffer(TRIANGLES).draw(buffer(TRIANGLES).getIndexed() ? triangles : made.corners ??= cornersOf(triangles, over));
    if (buffer(SIDES).getElementCount() > 0) buffer(SIDES).draw(made.sides ??= sidesOf(triangles));
  };
  publicAPI.updateBufferObjects = (renderer, actor) => {
    // What vtk.js looks at are its own lists.
    for (const primitive of model.primitives) primitive.getCABO().draw(null);
    const built = model.VBOBuildTime.getMTime();
    updateBufferObjects(renderer, actor);
    const coordinates = model.renderable.getColorCoordinates();
    const time = coordinates?.getMTime() ?? 0;
    // What was built just now has them already.
    if (coordinates && time !== coloured && built === model.VBOBuildTime.getMTime()) {
      for (const primitive of model.primitives) primitive.getCABO().recolour(coordinates.getData());
    }
    coloured = time;
    drawWanted();
  };
}
const makeNode = macro.newInstance(extendNode as never, "tombolo.SurfaceNode") as () => object;

/** Has surfaces drawn so. */
export function drawSurfacesFaster(): void {
  registerOverride("vtkMapper", makeNode);
}
