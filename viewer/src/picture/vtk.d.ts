/** Modules of vtk.js that come without types: what makes the buffers and draws the actors of a picture. */
declare module "@kitware/vtk.js/Rendering/OpenGL/CellArrayBufferObject" {
  const vtkOpenGLCellArrayBufferObject: { extend(publicAPI: object, model: object, initialValues?: object): void };
  export default vtkOpenGLCellArrayBufferObject;
}
declare module "@kitware/vtk.js/Rendering/OpenGL/PolyDataMapper" {
  const vtkOpenGLPolyDataMapper: { extend(publicAPI: object, model: object, initialValues?: object): void };
  export default vtkOpenGLPolyDataMapper;
}
declare module "@kitware/vtk.js/Rendering/OpenGL/ViewNodeFactory" {
  /** Has nodes for objects of a class made by a function. */
  export function registerOverride(className: string, make: (initialValues?: object) => object): void;
}
