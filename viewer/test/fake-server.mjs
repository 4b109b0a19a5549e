/**
 * A stand-in for a running simulation, to work on the viewer without one: a flat duct with a throat, a flow that moves, and
 * orders that scale the throat. `node test/fake-server.mjs [port]` prints the link.
 */
import { createReadStream, existsSync, readFileSync, statSync } from "node:fs";
import { createServer } from "node:http";
import { dirname, extname, join, normalize } from "node:path";
import { fileURLToPath } from "node:url";
import { WebSocketServer } from "ws";
import { dataFrame, topologyFrame } from "./frames.mjs";

const DIST = join(dirname(fileURLToPath(import.meta.url)), "..", "dist");
const ORDER_SCHEMA = JSON.parse(readFileSync(new URL("order-schema.json", import.meta.url), "utf8"));
const TYPES = { ".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml" };
const HALF = { x: 0.025, y: 0.525, z: 0.05 };
const ALONG = 180, ACROSS = 40, UP = 22;
const FEATURES = ["inlet", "outlet", "wall", "throat"];

function half(y) {
  return Math.abs(y) < 0.06 ? 0.55 : 1 - 0.45 * Math.exp(-(((Math.abs(y) - 0.06) / 0.12) ** 2));
}

/** The skin of the duct: rings of points along y, closed by caps. */
function duct() {
  const points = [], triangles = [], features = [];
  const side = ACROSS / 4;
  const ring = (y) => Array.from({ length: ACROSS }, (_, i) => {
    const k = Math.floor(i / side), t = ((i % side) / side) * 2 - 1;
    const [u, w] = [[t, -1], [1, t], [-t, 1], [-1, -t]][k];
    return [u * HALF.x, y, w * HALF.z * half(y)];
  });
  for (let j = 0; j <= ALONG; j++) for (const point of ring(-HALF.y + (2 * HALF.y * j) / ALONG)) points.push(...point);
  for (let j = 0; j < ALONG; j++) {
    const middle = -HALF.y + (2 * HALF.y * (j + 0.5)) / ALONG;
    for (let i = 0; i < ACROSS; i++) {
      const a = j * ACROSS + i, b = j * ACROSS + ((i + 1) % ACROSS);
      triangles.push(a, b, b + ACROSS, a, b + ACROSS, a + ACROSS);
      const feature = Math.abs(middle) < 0.06 ? 3 : 2;
      features.push(feature, feature);
    }
  }
  for (const [j, feature] of [[0, 0], [ALONG, 1]]) {
    const center = points.length / 3;
    points.push(0, j === 0 ? -HALF.y : HALF.y, 0);
    for (let i = 0; i < ACROSS; i++) {
      const a = j * ACROSS + i, b = j * ACROSS + ((i + 1) % ACROSS);
      triangles.push(...(j === 0 ? [center, b, a] : [center, a, b]));
      features.push(feature);
    }
  }
  return { points, triangles, features };
}

function slice() {
  const points = [], triangles = [];
  for (let j = 0; j <= ALONG; j++) {
    const y = -HALF.y + (2 * HALF.y * j) / ALONG;
    for (let i = 0; i <= UP; i++) points.push(0, y, ((2 * i) / UP - 1) * HALF.z * half(y));
  }
  for (let j = 0; j < ALONG; j++) for (let i = 0; i < UP; i++) {
    const a = j * (UP + 1) + i, b = a + UP + 1;
    triangles.push(a, b, b + 1, a, b + 1, a + 1);
  }
  return { points, triangles };
}

/** How much of an edit of the throat reaches a place along the duct. */
const weight = (y) => (Math.abs(y) <= 0.06 ? 1 : Math.max(0, 1 - (Math.abs(y) - 0.06) / (HALF.y - 0.06)) ** 2);

export function startFakeServer({ port = 0, token = "0123456789abcdef0123456789abcdef", period = 60 } = {}) {
  const skin = duct(), plane = slice();
  const views = [{ name: "surface", kind: "surface", ...skin }, { name: "midplane", kind: "slice", ...plane }];
  let cycle = 0, time = 0, paused = false, scale = 1, motion = null, clients = 0;
  let driver = null;
  const orders = [], stack = [], layers = [], parameters = [{ name: "inlet_velocity", value: 10, minimum: 0, maximum: 50 }];
  const sockets = new Map();

  const moved = (reference) => {
    const result = reference.slice();
    for (let i = 0; i < reference.length; i += 3) result[i + 2] *= 1 + (scale - 1) * weight(reference[i + 1]);
    return result;
  };
  const velocity = (points) => {
    const result = [];
    for (let i = 0; i < points.length; i += 3) {
      const [x, y, z] = points.slice(i, i + 3);
      const h = HALF.z * half(y) * (1 + (scale - 1) * weight(y));
      const jet = (HALF.z / h) * parameters[0].value;
      const profile = Math.max(0, 1 - (z / h) ** 6);
      const swirl = y > 0.05 ? 2.2 * Math.exp(-((z / h) ** 2)) * Math.sin(38 * y - time * 40) * Math.min(1, (y - 0.05) * 4) : 0;
      result.push(0, jet * profile * (1 - 1e-3 * x) + swirl, swirl * 0.5);
    }
    return result;
  };
  const pressure = (speeds) => Array.from({ length: speeds.length / 3 }, (_, i) => 300 - 0.5 * (speeds[3 * i] ** 2 + speeds[3 * i + 1] ** 2 + speeds[3 * i + 2] ** 2));
  const bounds = (feature) => {
    const points = moved(skin.points), low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    skin.features.forEach((f, t) => {
      if (f !== feature) return;
      for (let k = 0; k < 3; k++) for (let a = 0; a < 3; a++) {
        const value = points[3 * skin.triangles[3 * t + k] + a];
        low[a] = Math.min(low[a], value);
        high[a] = Math.max(high[a], value);
      }
    });
    return [low, high];
  };
  const hello = (client) => ({ hello: {
    protocol: 1, client, role: driver === client ? "driver" : "watcher", views: views.map(({ name, kind }) => ({ name, kind })), channel: "flow",
    features: FEATURES.map((name, i) => ({ name, faces: skin.features.filter((f) => f === i).length, vertices: 0, bounds: bounds(i) })),
    fields: [{ name: "velocity", association: "vertex", components: 3 }, { name: "pressure", association: "vertex", components: 1 }],
    parameters, schemas: { order: ORDER_SCHEMA }, stack: stack.flat(), orders,
    defaults: { schedule: { steps: 10, every: { steps: 1 } }, guard: { min_scaled_jacobian: 0.02, otherwise: "reject" }, deform: { method: "elasticity", stiffening: 1, poisson_ratio: 0.25, tolerance: 1e-8 } },
  } });
  const tell = (message) => { for (const socket of sockets.keys()) socket.send(JSON.stringify(message)); };
  const greet = () => { for (const [socket, client] of sockets) socket.send(JSON.stringify(hello(client))); };
  const order = (status) => {
    const known = orders.find((entry) => entry.id === status.id);
    if (known) Object.assign(known, status);
    else orders.push(status);
    tell({ order: orders.find((entry) => entry.id === status.id) });
  };
  const target = () => layers.reduce((product, layer) => product * layer, 1);

  const take = (id, body) => {
    const before = scale;
    if (body.undo !== undefined) {
      if (stack.length === 0) return order({ id, status: "rejected", reason: "there is no order to take back: the shape is the reference" });
      stack.pop();
      layers.pop();
    } else {
      let factor = 1;
      for (const edit of body.edits ?? []) {
        const name = Object.keys(edit)[0];
        for (const feature of [...edit[name].features, ...edit[name].fixed]) if (!FEATURES.includes(feature)) return order({ id, status: "rejected", reason: `edits[0]: unknown feature "${feature}"` });
        if (name === "scale_direction") factor *= edit[name].factors[2];
      }
      if (factor * target() < 0.1) {
        return order({ id, status: "rejected", min_scaled_jacobian: -0.31, reason: `the mesh would break: 412 elements invert, the worst is cell 20417 at (0.004, -0.013, 0.027) with a scaled Jacobian of -0.31.\nThe largest feasible fraction of this edit is 0.83.` });
      }
      stack.push(body.edits);
      layers.push(factor);
    }
    order({ id, status: "accepted", reason: null, cycle_applied: null });
    setTimeout(() => order({ id, status: "computing" }), 150);
    setTimeout(() => { motion = { id, from: before, to: target(), shapes: body.schedule?.steps ?? 1, shape: 0 }; }, 900);
  };

  const step = () => {
    if (paused) return;
    cycle += 1;
    time = cycle * 1e-3;
    if (motion) {
      motion.shape += 1;
      const { id, from, to, shape, shapes } = motion;
      scale = shape === shapes ? to : from + ((to - from) * shape) / shapes;
      order({ id, status: shape === shapes ? "applied" : "applying", shape, shapes, ...(shape === shapes ? { cycle_applied: cycle, min_scaled_jacobian: 0.214 * scale + 0.02, seconds: { surface: 0.041, volume: 0.52, guard: 0.067 }, added_steps: 3.1 } : {}) });
      if (shape === shapes) {
        motion = null;
        greet();
      }
    }
    for (const view of views) {
      const points = moved(view.points), speeds = velocity(view.points);
      const bytes = dataFrame(view.name, `${view.name}-1`, cycle, time, [
        { name: "points", components: 3, values: points, type: "u32" }, { name: "velocity", components: 3, values: speeds },
        { name: "pressure", components: 1, values: pressure(speeds) },
      ]);
      for (const socket of sockets.keys()) if (socket.bufferedAmount < 1e5) socket.send(bytes);
    }
    tell({ monitor: { pipeline: "health", cycle, values: { "quality.min": 0.214 * scale + 0.02, "velocity.max": 22.4 / scale } } });
  };
  const status = () => tell({ status: { cycle, time, paused, stopped: false, step_seconds: 0.0613, viewers: sockets.size, driver, quality: { min: 0.214 * scale + 0.02, mean: 0.71, inverted: 0 } } });

  const http = createServer((request, response) => {
    const url = new URL(request.url, "http://x");
    if (url.pathname === "/ws") return response.writeHead(url.searchParams.get("token") === token ? 426 : 401).end();
    const file = join(DIST, normalize(url.pathname === "/" ? "/index.html" : url.pathname));
    if (!file.startsWith(DIST) || !existsSync(file) || !statSync(file).isFile()) return response.writeHead(404).end();
    response.writeHead(200, { "content-type": TYPES[extname(file)] ?? "application/octet-stream" });
    createReadStream(file).pipe(response);
  });
  const server = new WebSocketServer({ noServer: true });
  http.on("upgrade", (request, socket, head) => {
    const url = new URL(request.url, "http://x");
    if (url.searchParams.get("token") !== token) return socket.end("HTTP/1.1 401 Unauthorized\r\ncontent-length: 0\r\nconnection: close\r\n\r\n");
    server.handleUpgrade(request, socket, head, (viewer) => {
      const client = `c${++clients}`;
      driver ??= client;
      sockets.set(viewer, client);
      viewer.on("error", () => {});
      viewer.on("close", () => {
        sockets.delete(viewer);
        if (driver === client) driver = sockets.values().next().value ?? null;
        greet();
      });
      viewer.on("message", (data) => {
        const message = JSON.parse(data.toString());
        if (message.drive) { driver = client; return greet(); }
        if (driver !== client) return viewer.send(JSON.stringify({ error: { id: message.id, message: "only the driver steers; this viewer watches" } }));
        if (message.order) take(message.id, message.order);
        if (message.forecast) {
          const quality = { min: 0.214 * scale, mean: 0.7, inverted: 0 };
          const order = { outcome: "applied", reason: null, fraction: 1, min_scaled_jacobian: quality.min, shapes: 10, quality, seconds: { surface: 0.041, volume: 0.52, guard: 0.067 } };
          setTimeout(() => viewer.send(JSON.stringify({ forecast: { id: message.id, order } })), 300);
        }
        if (message.pause) paused = true;
        if (message.resume) paused = false;
        if (message.parameter) {
          parameters.find((parameter) => parameter.name === message.parameter.name).value = message.parameter.value;
          greet();
        }
        status();
      });
      viewer.send(JSON.stringify(hello(client)));
      for (const view of views) viewer.send(topologyFrame(view.name, `${view.name}-1`, view.points.length / 3, view.triangles, view.features ?? null));
      status();
    });
  });
  const timers = [setInterval(step, period), setInterval(status, 200)];
  return new Promise((resolve) => http.listen(port, "127.0.0.1", () => resolve({
    url: `http://127.0.0.1:${http.address().port}/?token=${token}`,
    close: () => {
      timers.forEach(clearInterval);
      for (const socket of sockets.keys()) socket.terminate();
      http.close();
      http.closeAllConnections();
    },
  })));
}

if (process.argv[1] === fileURLToPath(import.meta.url)) {
  const { url } = await startFakeServer({ port: Number(process.argv[2] ?? 7071) });
  console.log(url);
}
