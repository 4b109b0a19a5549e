/**
 * The canvas of vtk.js, made so that a picture is cheap: see-through surfaces are blended as they come, and a machine that draws with
 * its processor smooths no edges.
 */
import "@kitware/vtk.js/Rendering/OpenGL/Actor";
import "@kitware/vtk.js/Rendering/OpenGL/Camera";
import "@kitware/vtk.js/Rendering/OpenGL/PolyDataMapper";
import "@kitware/vtk.js/Rendering/OpenGL/Renderer";
import vtkOpenGLRenderWindow from "@kitware/vtk.js/Rendering/OpenGL/RenderWindow";

/** The part of vtk.js's tree of nodes that a pass needs; its types do not tell of it. */
interface Node { traverse(pass: unknown): void; getContext(): WebGL2RenderingContext }

/**
 * Draws see-through actors one after the other over what is there. vtk.js's own pass sums all fragments in two further pictures of 16-bit
 * floats, which takes several times as long as all the rest where a processor draws.
 */
const blending = {
  getOperation: () => "translucentPass",
  getTraverseOperation: () => "traverseTranslucentPass",
  getShaderReplacement: () => null,
  releaseGraphicsResources: () => undefined,
  traverse(window: Node, renderer: Node): void {
    const context = window.getContext();
    context.enable(context.BLEND);
    context.blendFuncSeparate(context.SRC_ALPHA, context.ONE_MINUS_SRC_ALPHA, context.ONE, context.ONE_MINUS_SRC_ALPHA);
    renderer.traverse(blending);
  },
};

/** Whether WebGL is drawn by the processor: names of Chromium, Mesa and Windows for what does that. */
export function drawnByProcessor(renderer: string): boolean {
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(renderer);
}

/** What draws WebGL here, as far as the browser tells. */
function rendererName(): string {
  const context = document.createElement("canvas").getContext("webgl2");
  if (!context) return "";
  const details = context.getExtension("WEBGL_debug_renderer_info");
  const name = String(context.getParameter(details ? details.UNMASKED_RENDERER_WEBGL : context.RENDERER));
  context.getExtension("WEBGL_lose_context")?.loseContext();
  return name;
}

export interface Canvas { window: vtkOpenGLRenderWindow; byProcessor: boolean }

export function makeCanvas(): Canvas {
  const window = vtkOpenGLRenderWindow.newInstance();
  const byProcessor = drawnByProcessor(rendererName());
  // The first to ask for the context says what it is like.
  window.getCanvas()?.getContext("webgl2", {
    antialias: !byProcessor, depth: true, alpha: true, preserveDrawingBuffer: false, powerPreference: "high-performance",
  });
  window.getRenderPasses()?.[0]?.set({ translucentPass: blending }, true, true);
  return { window, byProcessor };
}
