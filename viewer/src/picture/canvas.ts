/**
 * The canvas of vtk.js, made so that a picture is cheap: see-through surfaces are blended as they come, and a machine that draws with
 * its processor smooths no edges.
 */
import "@kitware/vtk.js/Rendering/OpenGL/Actor";
import "@kitware/vtk.js/Rendering/OpenGL/Camera";
import "@kitware/vtk.js/Rendering/OpenGL/Renderer";
import vtkOpenGLRenderWindow from "@kitware/vtk.js/Rendering/OpenGL/RenderWindow";
import { drawSurfacesFaster } from "./surface-node";

drawSurfacesFaster();

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
    // What hides all behind it is drawn without looking at that.
    context.disable(context.BLEND);
  },
};

/** Whether WebGL is drawn by the processor: names of Chromium, Mesa and Windows for what does that. */
export function drawnByProcessor(renderer: string): boolean {
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(renderer);
}

/** A canvas for WebGL 2, as vtk.js makes one. */
function canvasFor(antialias: boolean): { canvas: HTMLCanvasElement; context: WebGL2RenderingContext } {
  const canvas = document.createElement("canvas");
  canvas.style.width = "100%";
  // The first to ask for the context says what it is like: the picture hides the page behind it.
  const context = canvas.getContext("webgl2", { antialias, depth: true, alpha: false, preserveDrawingBuffer: false, powerPreference: "high-performance" });
  if (!context) throw new Error("WebGL 2 is missing");
  return { canvas, context };
}

/** What draws WebGL here, as far as the browser tells. */
function rendererName(context: WebGL2RenderingContext): string {
  const details = context.getExtension("WEBGL_debug_renderer_info");
  return String(context.getParameter(details ? details.UNMASKED_RENDERER_WEBGL : context.RENDERER));
}

export interface Canvas { window: vtkOpenGLRenderWindow; byProcessor: boolean }

/** Fails where the browser has no WebGL 2. */
export function makeCanvas(): Canvas {
  // Where a processor draws, which takes the longest to make one, the first is the one that is wanted.
  let { canvas, context } = canvasFor(false);
  const byProcessor = drawnByProcessor(rendererName(context));
  if (!byProcessor) {
    context.getExtension("WEBGL_lose_context")?.loseContext();
    ({ canvas, context } = canvasFor(true));
  }
  const window = vtkOpenGLRenderWindow.newInstance({ canvas });
  window.getRenderPasses()?.[0]?.set({ translucentPass: blending }, true, true);
  return { window, byProcessor };
}
