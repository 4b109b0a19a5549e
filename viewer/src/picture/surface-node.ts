/**
 * What draws the surfaces: vtk.js's own node, which however writes colours that change into the buffer that is there. vtk.js packs all
 * points anew for them, counts the corners of all cells, makes the texture and puts its shaders together to find that they are the same.
 */
import macro from "@kitware/vtk.js/macros";
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

function extendBuffer(publicAPI: PointBuffer, model: BufferModel, initialValues: object = {}): void {
  vtkOpenGLCellArrayBufferObject.extend(publicAPI, model, initialValues);
  keepPacked(publicAPI, model);
}
const makeBuffer = macro.newInstance(extendBuffer as never, "tombolo.PointBuffer") as () => PointBuffer;

interface Node { updateBufferObjects(renderer: unknown, actor: unknown): void }
interface NodeModel {
  primitives: { getCABO(): PointBuffer; setCABO(buffer: PointBuffer): void }[];
  VBOBuildTime: { getMTime(): number };
  renderable: { getColorCoordinates(): Coordinates | null };
}

function extendNode(publicAPI: Node, model: NodeModel, initialValues: object = {}): void {
  vtkOpenGLPolyDataMapper.extend(publicAPI, model, initialValues);
  for (const primitive of model.primitives) primitive.setCABO(makeBuffer());
  const { updateBufferObjects } = publicAPI;
  let coloured = 0;
  publicAPI.updateBufferObjects = (renderer, actor) => {
    const built = model.VBOBuildTime.getMTime();
    updateBufferObjects(renderer, actor);
    const coordinates = model.renderable.getColorCoordinates();
    const time = coordinates?.getMTime() ?? 0;
    // What was built just now has them already.
    if (coordinates && time !== coloured && built === model.VBOBuildTime.getMTime()) {
      for (const primitive of model.primitives) primitive.getCABO().recolour(coordinates.getData());
    }
    coloured = time;
  };
}
const makeNode = macro.newInstance(extendNode as never, "tombolo.SurfaceNode") as () => object;

/** Has surfaces drawn so. */
export function drawSurfacesFaster(): void {
  registerOverride("vtkMapper", makeNode);
}
