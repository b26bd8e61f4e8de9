"use strict";
// Plays a film: a stage (what there is) and reels (pictures one after the other). Metres, seconds, z up.

const COLOURS = ["#d64045", "#1f77b4", "#945abe", "#2a9d5c", "#e08a00", "#555"];
const KINDS = { u2: Uint16Array, u4: Uint32Array, f4: Float32Array, f8: Float64Array };
const byId = (id) => document.getElementById(id);
const clamp = (x, low, high) => Math.min(high, Math.max(low, x));

// ---- reading

async function unpack(text) {
  const raw = atob(text), bytes = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
  const stream = new Response(bytes).body.pipeThrough(new DecompressionStream("deflate"));
  const buffer = await new Response(stream).arrayBuffer();
  return ([kind, first, count]) => new KINDS[kind](buffer, first, count);
}

class Film {
  constructor(stage) {
    this.stage = stage;
    this.times = [];
    this.bodies = stage.bodies.map(() => []); // for each picture {low, step, whole}
    this.poses = stage.pieces.map(() => []);
    this.curves = stage.curves.map(() => []);
    this.events = [];
  }

  get length() { return this.times.length; }
  get start() { return this.times[0] || 0; }
  get end() { return this.times[this.length - 1] || 0; }

  async append(reel) {
    const read = await unpack(reel.data), times = read(reel.times), k = times.length;
    this.stage.bodies.forEach((body, b) => {
      const low = read(reel.bodies[b].low), step = read(reel.bodies[b].step), whole = read(reel.bodies[b].positions);
      const n = 3 * body.nodes;
      for (let i = n; i < whole.length; i++) whole[i] += whole[i - n]; // wraps, as it did when it was packed
      for (let i = 0; i < k; i++) this.bodies[b].push({
        low: low.subarray(3 * i, 3 * i + 3), step: step.subarray(3 * i, 3 * i + 3), whole: whole.subarray(n * i, n * i + n) });
    });
    let moving = 0;
    this.stage.pieces.forEach((piece, p) => {
      if (!piece.moves) return;
      const poses = read(reel.poses[moving++]);
      for (let i = 0; i < k; i++) this.poses[p].push(poses.subarray(7 * i, 7 * i + 7));
    });
    this.stage.curves.forEach((curve, c) => {
      const values = read(reel.curves[c]), w = curve.names.length;
      for (let i = 0; i < k; i++) this.curves[c].push(values.subarray(w * i, w * i + w));
    });
    this.events.push(...reel.events);
    for (const t of times) this.times.push(t);
  }

  // The picture at or before a time, and how far it is to the next, 0 to 1.
  at(time) {
    const t = this.times;
    let low = 0, high = t.length - 1;
    while (low < high) { const mid = (low + high + 1) >> 1; if (t[mid] <= time) low = mid; else high = mid - 1; }
    return low + 1 < t.length ? [low, clamp((time - t[low]) / (t[low + 1] - t[low]), 0, 1)] : [low, 0];
  }

  // Nodes of body b about `origin`, between two pictures.
  nodes(b, [i, w], origin, out) {
    const one = this.bodies[b][i], two = w > 0 ? this.bodies[b][i + 1] : one;
    for (let a = 0; a < 3; a++) {
      const p = (1 - w) * one.step[a], q = w * two.step[a], o = (1 - w) * one.low[a] + w * two.low[a] - origin[a];
      for (let j = a; j < out.length; j += 3) out[j] = o + p * one.whole[j] + q * two.whole[j];
    }
  }

  // Pose of piece p between two pictures, null where it is not there.
  pose(p, [i, w]) {
    const one = this.poses[p][i], two = w > 0 ? this.poses[p][i + 1] : one;
    const sign = one[3] * two[3] + one[4] * two[4] + one[5] * two[5] + one[6] * two[6] < 0 ? -1 : 1;
    const pose = Array.from(one, (x, j) => (1 - w) * x + w * two[j] * (j < 3 ? 1 : sign));
    if (!pose.every(Number.isFinite)) return null;
    const norm = Math.hypot(pose[3], pose[4], pose[5], pose[6]) || 1;
    for (let j = 3; j < 7; j++) pose[j] /= norm;
    return pose;
  }

  // Where the bodies are, for a camera that goes along.
  middle([i]) {
    const m = [0, 0, 0];
    let count = 0;
    const add = (x, y, z) => { m[0] += x; m[1] += y; m[2] += z; count++; };
    this.stage.bodies.forEach((body, b) => {
      if (!body.nodes || !body.seen) return;
      const { low, step, whole } = this.bodies[b][i], s = [0, 0, 0];
      for (let j = 0; j < whole.length; j++) s[j % 3] += whole[j];
      add(...s.map((x, a) => low[a] + step[a] * x / body.nodes));
    });
    if (!count) this.poses.forEach((poses) => { if (poses.length && Number.isFinite(poses[i][0])) add(...poses[i].slice(0, 3)); });
    return count ? m.map((x) => x / count) : this.stage.camera.centre;
  }
}

// ---- matrices, column by column

function product(a, b) {
  const out = new Float32Array(16);
  for (let c = 0; c < 4; c++) for (let r = 0; r < 4; r++)
    out[4 * c + r] = a[r] * b[4 * c] + a[4 + r] * b[4 * c + 1] + a[8 + r] * b[4 * c + 2] + a[12 + r] * b[4 * c + 3];
  return out;
}

function frame(pose, origin) {
  const [px, py, pz, x, y, z, w] = pose;
  return new Float32Array([
    1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w), 0,
    2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w), 0,
    2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y), 0,
    px - origin[0], py - origin[1], pz - origin[2], 1]);
}

// ---- drawing

const VERTEX = `#version 300 es
in vec3 p; uniform mat4 model, view; uniform float flatten, ground; out vec3 at;
void main() {
  vec4 world = model * vec4(p, 1.0);
  if (flatten > 0.5) world.xyz = vec3(world.xy - 0.25 * max(world.z - ground, 0.0) * vec2(0.6, -0.3), ground);
  at = world.xyz;
  gl_Position = view * world;
}`;
const FRAGMENT = `#version 300 es
precision highp float;
in vec3 at; uniform vec3 eye; uniform vec4 colour; uniform float lit; out vec4 result;
void main() {
  vec3 n = normalize(cross(dFdx(at), dFdy(at)));
  if (dot(n, eye - at) < 0.0) n = -n;
  float light = 0.52 + 0.16 * n.z + 0.40 * max(dot(n, normalize(vec3(0.6, -0.3, 1.0))), 0.0)
    + 0.12 * max(dot(n, normalize(vec3(-0.6, 0.7, 0.3))), 0.0);
  result = vec4(mix(colour.rgb, colour.rgb * light, lit) * colour.a, colour.a); // as the page blends it
}`;

class Painter {
  constructor(canvas) {
    this.gl = canvas.getContext("webgl2", { antialias: true, stencil: true });
    this.canvas = canvas;
    if (this.gl) this.prepare();
  }

  prepare() {
    const gl = this.gl, program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.bindAttribLocation(program, 0, "p");
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    gl.useProgram(program);
    this.at = {};
    for (const name of ["model", "view", "flatten", "ground", "eye", "colour", "lit"])
      this.at[name] = gl.getUniformLocation(program, name);
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.POLYGON_OFFSET_FILL);
    gl.polygonOffset(1, 1);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
  }

  // What is drawn from arrays: vertices that may change, triangles and lines between them.
  shape(vertices, triangles, lines, changes) {
    const gl = this.gl, array = gl.createVertexArray(), buffer = gl.createBuffer();
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, vertices, changes ? gl.DYNAMIC_DRAW : gl.STATIC_DRAW);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
    const indices = (list) => {
      const made = gl.createBuffer();
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, made);
      gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, list, gl.STATIC_DRAW);
      return made;
    };
    return { array, buffer, vertices, triangles: indices(triangles), corners: triangles.length,
      lines: indices(lines), ends: lines.length };
  }

  update(shape) {
    const gl = this.gl;
    gl.bindBuffer(gl.ARRAY_BUFFER, shape.buffer);
    gl.bufferSubData(gl.ARRAY_BUFFER, 0, shape.vertices);
  }

  begin(view, eye, ground) {
    const gl = this.gl, ratio = Math.min(window.devicePixelRatio || 1, 2);
    const w = Math.round(this.canvas.clientWidth * ratio), h = Math.round(this.canvas.clientHeight * ratio);
    if (this.canvas.width !== w || this.canvas.height !== h) { this.canvas.width = w; this.canvas.height = h; }
    gl.viewport(0, 0, w, h);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT | gl.STENCIL_BUFFER_BIT);
    gl.uniformMatrix4fv(this.at.view, false, view);
    gl.uniform3fv(this.at.eye, eye);
    gl.uniform1f(this.at.ground, ground);
    gl.uniform1f(this.at.flatten, 0);
  }

  draw(shape, model, colour, { lines = false, alpha = 1 } = {}) {
    const gl = this.gl;
    gl.bindVertexArray(shape.array);
    gl.uniformMatrix4fv(this.at.model, false, model);
    gl.uniform4f(this.at.colour, colour[0] / 255, colour[1] / 255, colour[2] / 255, alpha);
    gl.uniform1f(this.at.lit, lines ? 0 : 1);
    if (alpha < 1) gl.enable(gl.BLEND);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, lines ? shape.lines : shape.triangles);
    gl.drawElements(lines ? gl.LINES : gl.TRIANGLES, lines ? shape.ends : shape.corners, gl.UNSIGNED_INT, 0);
    gl.disable(gl.BLEND);
  }

  // What is inside others, faintly.
  through(draw) {
    this.gl.disable(this.gl.DEPTH_TEST);
    draw();
    this.gl.enable(this.gl.DEPTH_TEST);
  }

  // Shadows on the ground, each spot once.
  shadows(draw) {
    const gl = this.gl;
    gl.enable(gl.STENCIL_TEST);
    gl.stencilFunc(gl.EQUAL, 0, 255);
    gl.stencilOp(gl.KEEP, gl.KEEP, gl.INCR);
    gl.uniform1f(this.at.flatten, 1);
    gl.depthMask(false);
    draw();
    gl.depthMask(true);
    gl.uniform1f(this.at.flatten, 0);
    gl.disable(gl.STENCIL_TEST);
  }
}

// ---- the camera

class Camera {
  constructor(from) {
    this.from = from;
    this.home();
  }

  home() {
    const { centre, radius, azimuth, elevation, follow } = this.from;
    Object.assign(this, { centre: [...centre], radius, follow, touched: false });
    this.azimuth = azimuth * Math.PI / 180;
    this.elevation = elevation * Math.PI / 180;
  }

  get axes() {
    const [ca, sa, ce, se] = [Math.cos(this.azimuth), Math.sin(this.azimuth), Math.cos(this.elevation), Math.sin(this.elevation)];
    return { back: [ce * ca, ce * sa, se], right: [-sa, ca, 0], up: [-se * ca, -se * sa, ce] };
  }

  // View and projection about the centre, and the eye from there.
  look(aspect) {
    const half = 0.3, { back, right, up } = this.axes; // half the angle of view [rad]
    const d = this.radius / Math.sin(half) / Math.min(1, aspect), near = 0.02 * d, far = 60 * d;
    const f = 1 / Math.tan(half), projection = new Float32Array([f / aspect, 0, 0, 0, 0, f, 0, 0,
      0, 0, (far + near) / (near - far), -1, 0, 0, 2 * far * near / (near - far), 0]);
    const view = new Float32Array([right[0], up[0], back[0], 0, right[1], up[1], back[1], 0, right[2], up[2], back[2], 0,
      0, 0, -d, 1]);
    return { matrix: product(projection, view), eye: back.map((x) => x * d), distance: d };
  }

  turn(dx, dy) {
    this.touched = true;
    this.azimuth -= dx;
    this.elevation = clamp(this.elevation + dy, -1.55, 1.55);
  }

  shift(dx, dy) {
    const { right, up } = this.axes;
    this.touched = true;
    for (let a = 0; a < 3; a++) this.centre[a] -= this.radius * (dx * right[a] - dy * up[a]);
  }

  zoom(factor) {
    this.touched = true;
    this.radius = clamp(this.radius * factor, 0.02 * this.from.radius, 50 * this.from.radius);
  }
}

function steer(canvas, camera, redraw) {
  const fingers = new Map();
  const spread = () => { const [a, b] = [...fingers.values()]; return Math.hypot(a.x - b.x, a.y - b.y); };
  canvas.addEventListener("pointerdown", (e) => { canvas.setPointerCapture(e.pointerId); fingers.set(e.pointerId, { x: e.clientX, y: e.clientY }); });
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (e) => fingers.delete(e.pointerId));
  canvas.addEventListener("pointermove", (e) => {
    const old = fingers.get(e.pointerId);
    if (!old) return;
    const size = canvas.clientHeight, dx = (e.clientX - old.x) / size, dy = (e.clientY - old.y) / size;
    const before = fingers.size === 2 ? spread() : 0;
    fingers.set(e.pointerId, { x: e.clientX, y: e.clientY });
    if (fingers.size === 2) { camera.zoom(before / (spread() || before)); camera.shift(dx, dy); }
    else if (e.buttons === 2 || e.shiftKey) camera.shift(2 * dx, 2 * dy);
    else camera.turn(5 * dx, 5 * dy);
    redraw();
  });
  canvas.addEventListener("wheel", (e) => { e.preventDefault(); camera.zoom(Math.exp(0.001 * e.deltaY)); redraw(); }, { passive: false });
  canvas.addEventListener("contextmenu", (e) => e.preventDefault());
}

// ---- the curves

class Plot {
  constructor(parent, film, index, seek) {
    this.film = film; this.index = index; this.curve = film.stage.curves[index];
    const title = document.createElement("h2");
    title.textContent = `${this.curve.title} [${this.curve.unit}]`;
    this.legend = document.createElement("div");
    this.legend.className = "legend";
    this.canvas = document.createElement("canvas");
    this.canvas.setAttribute("aria-label", this.curve.title);
    parent.append(title, this.legend, this.canvas);
    const pick = (e) => {
      const box = this.canvas.getBoundingClientRect(), share = clamp((e.clientX - box.left) / box.width, 0, 1);
      seek(film.start + share * (film.end - film.start));
    };
    this.canvas.addEventListener("pointerdown", (e) => { this.canvas.setPointerCapture(e.pointerId); pick(e); });
    this.canvas.addEventListener("pointermove", (e) => { if (e.buttons) pick(e); });
  }

  draw(time) {
    const { film, curve, canvas } = this, rows = film.curves[this.index], ratio = Math.min(window.devicePixelRatio || 1, 2);
    const w = canvas.clientWidth, h = canvas.clientHeight, pen = canvas.getContext("2d");
    if (!w || !rows.length) return;
    canvas.width = Math.round(w * ratio); canvas.height = Math.round(h * ratio);
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    let low = Infinity, high = -Infinity;
    for (const row of rows) for (const v of row) if (Number.isFinite(v)) { low = Math.min(low, v); high = Math.max(high, v); }
    if (low > high) [low, high] = [0, 1];
    const near = curve.limits.filter((v) => v > low - (high - low) && v < high + (high - low));
    low = Math.min(low, ...near); high = Math.max(high, ...near);
    const pad = Math.max(0.06 * (high - low), 0.02 * Math.max(Math.abs(low), Math.abs(high))) || 1, span = film.end - film.start || 1;
    low -= pad; high += pad;
    const x = (t) => (t - film.start) / span * w, y = (v) => h - (v - low) / (high - low) * h;
    pen.fillStyle = "#f7f9fb";
    pen.fillRect(0, 0, w, h);
    const line = (colour, dash, ...points) => {
      pen.strokeStyle = colour; pen.setLineDash(dash); pen.beginPath();
      points.forEach(([a, b], i) => (i ? pen.lineTo(a, b) : pen.moveTo(a, b)));
      pen.stroke();
    };
    if (low < 0 && high > 0) line("#ccd", [], [0, y(0)], [w, y(0)]);
    for (const v of near) line("#c33", [4, 3], [0, y(v)], [w, y(v)]);
    const stride = Math.max(1, Math.floor(rows.length / (2 * w)));
    curve.names.forEach((_, c) => {
      pen.strokeStyle = COLOURS[c % COLOURS.length]; pen.setLineDash([]); pen.lineWidth = 1.4; pen.beginPath();
      let down = false;
      for (let i = 0; i < rows.length; i += stride) {
        const v = rows[i][c];
        if (!Number.isFinite(v)) { down = false; continue; }
        if (down) pen.lineTo(x(film.times[i]), y(v)); else pen.moveTo(x(film.times[i]), y(v));
        down = true;
      }
      pen.stroke();
    });
    pen.lineWidth = 1;
    line("#222", [], [x(time), 0], [x(time), h]);
    pen.fillStyle = "#667"; pen.font = "11px system-ui, sans-serif";
    const digits = clamp(2 - Math.floor(Math.log10(high - low)), 0, 6), words = (v) => (Number.isFinite(v) ? v.toFixed(digits).replace(/^-(?=[0.]+$)/, "") : "\u2013");
    pen.fillText(words(high - pad), 3, 11);
    pen.fillText(words(low + pad), 3, h - 3);
    const [i] = film.at(time);
    this.legend.replaceChildren(...curve.names.flatMap((name, c) => {
      const text = document.createElement("b");
      text.style.color = COLOURS[c % COLOURS.length];
      text.textContent = `${name} `;
      return [text, `${words(rows[i][c])}  `];
    }));
  }
}

// ---- the ground

function ground(camera) {
  const cell = 10 ** Math.floor(Math.log10(camera.radius)) * (camera.radius / 10 ** Math.floor(Math.log10(camera.radius)) > 4 ? 1 : 0.2);
  const count = Math.ceil(2.5 * camera.radius / cell), reach = count * cell, lines = [], vertices = [];
  const cx = Math.round(camera.centre[0] / cell) * cell, cy = Math.round(camera.centre[1] / cell) * cell;
  for (let i = -count; i <= count; i++) {
    vertices.push(cx + i * cell, cy - reach, 0, cx + i * cell, cy + reach, 0);
    vertices.push(cx - reach, cy + i * cell, 0, cx + reach, cy + i * cell, 0);
  }
  for (let i = 0; i < vertices.length / 3; i++) lines.push(i);
  return { vertices: new Float32Array(vertices), lines: new Uint32Array(lines), cell };
}

// ---- all together

async function main() {
  const stage = JSON.parse(byId("film").textContent), first = JSON.parse(byId("reel").textContent);
  byId("description").textContent = stage.description;
  if (typeof DecompressionStream === "undefined") throw new Error("this browser is too old for this page: it cannot unpack it");
  const film = new Film(stage), camera = new Camera(stage.camera), painter = new Painter(byId("picture"));
  if (!painter.gl) throw new Error("this browser has no WebGL 2, so the picture stays empty; the curves still play. Switch on hardware acceleration in the settings of the browser, or open this page in another one (Firefox, Chrome)");
  const read = await unpack(stage.data), none = new Uint32Array(0);
  const bodies = stage.bodies.map((b) => painter.shape(new Float32Array(3 * b.nodes), read(b.triangles), read(b.edges), true));
  const pieces = stage.pieces.map((p) => painter.shape(read(p.vertices), read(p.triangles), none, false));
  let grid, floor;
  function layGround() {
    grid = ground(stage.camera);
    floor = painter.shape(grid.vertices, none, grid.lines, false);
    byId("scale").textContent = `one square of the floor: ${length(grid.cell)}`;
  }
  layGround();

  let time = 0, playing = false, asked = 0, live = !first, showLines = false, waiting = false;
  const redraw = () => { if (!asked) asked = requestAnimationFrame(paint); };
  const seek = (t) => { time = clamp(t, film.start, film.end); redraw(); };
  const plots = [];
  const side = byId("side");
  stage.curves.forEach((_, c) => plots.push(new Plot(side, film, c, (t) => { play(false); seek(t); })));
  const happened = document.createElement("ul"), source = document.createElement("p");
  source.className = "source"; source.textContent = stage.source;
  if (plots.length || stage.source) side.append(happened, source);

  function tell() {
    happened.replaceChildren(...film.events.map(([t, text]) => {
      const item = document.createElement("li"), button = document.createElement("button");
      button.textContent = `${t.toFixed(2)} s  ${text}`;
      button.addEventListener("click", () => { play(false); seek(t); });
      item.append(button);
      return item;
    }));
  }

  function paint(now) {
    asked = 0;
    if (playing) {
      const passed = Math.min((now - (paint.last ?? now)) / 1000, 0.25) * Number(byId("speed").value);
      time += passed;
      if (time >= film.end) { time = film.end; if (live) waiting = true; else play(false); }
      paint.last = now;
    }
    if (film.length) picture();
    if (playing) redraw();
  }

  function picture() {
    const moment = film.at(time), identity = frame([0, 0, 0, 0, 0, 0, 1], [0, 0, 0]);
    const origin = camera.follow ? film.middle(moment).map((x, a) => x + camera.centre[a] - stage.camera.centre[a]) : camera.centre;
    const aspect = byId("picture").clientWidth / byId("picture").clientHeight || 1;
    const { matrix, eye } = camera.look(aspect);
    const still = frame([0, 0, 0, 0, 0, 0, 1], origin), height = stage.camera.floor - origin[2];
    painter.begin(matrix, new Float32Array(eye), height);
    const drawn = [];
    bodies.forEach((shape, b) => { film.nodes(b, moment, origin, shape.vertices); painter.update(shape); drawn.push([shape, identity, stage.bodies[b].colour]); });
    pieces.forEach((shape, p) => {
      const pose = stage.pieces[p].moves ? film.pose(p, moment) : null;
      if (pose || !stage.pieces[p].moves) drawn.push([shape, pose ? frame(pose, origin) : still, stage.pieces[p].colour]);
    });
    const about = [0, 1].map((a) => (camera.follow ? Math.round((origin[a] - stage.camera.centre[a]) / grid.cell) * grid.cell : 0));
    painter.draw(floor, frame([...about, stage.camera.floor, 0, 0, 0, 1], origin), [120, 135, 150], { lines: true, alpha: 0.35 });
    if (eye[2] > height) painter.shadows(() => drawn.forEach(([shape, model]) => painter.draw(shape, model, [40, 50, 60], { alpha: 0.13 })));
    drawn.forEach(([shape, model, colour]) => painter.draw(shape, model, colour));
    painter.through(() => bodies.forEach((shape, b) => stage.bodies[b].through && painter.draw(shape, identity, stage.bodies[b].colour, { alpha: 0.35 })));
    if (showLines) bodies.forEach((shape) => painter.draw(shape, identity, [60, 35, 15], { lines: true, alpha: 0.55 }));
    plots.forEach((plot) => plot.draw(time));
    const bar = byId("time");
    bar.min = film.start; bar.max = film.end; bar.value = time;
    byId("clock").textContent = `${time.toFixed(2)} of ${film.end.toFixed(2)} s`;
    const past = film.events.filter(([t]) => t <= time + 1e-9).map(([, text]) => text);
    byId("message").textContent = past.length ? past[past.length - 1] : "";
  }

  function play(on) {
    playing = on && film.length > 1;
    if (playing && time >= film.end && !live) time = film.start;
    paint.last = undefined;
    byId("play").textContent = playing ? "\u275A\u275A" : "\u25B6";
    redraw();
  }

  byId("play").addEventListener("click", () => play(!playing));
  byId("time").addEventListener("input", (e) => { play(false); seek(Number(e.target.value)); });
  const toggleLines = () => { showLines = !showLines; byId("lines").setAttribute("aria-pressed", showLines); redraw(); };
  byId("lines").addEventListener("click", toggleLines);
  const home = () => { camera.home(); redraw(); };
  byId("home").addEventListener("click", home);
  steer(byId("picture"), camera, redraw);
  window.addEventListener("resize", redraw);
  window.addEventListener("keydown", (e) => {
    if (e.ctrlKey || e.altKey || e.metaKey || ["INPUT", "SELECT"].includes(e.target.tagName) && e.key !== " ") return;
    const [i] = film.at(time);
    const act = { " ": () => play(!playing), ArrowRight: () => { play(false); seek(film.times[Math.min(i + 1, film.length - 1)]); },
      ArrowLeft: () => { play(false); seek(film.times[Math.max(i - 1, 0)]); }, Home: () => seek(film.start), End: () => seek(film.end),
      l: toggleLines, r: home }[e.key];
    if (act) { e.preventDefault(); if (e.target.blur) e.target.blur(); act(); }
  });

  const wanted = /^#t=([\d.]+)$/.exec(location.hash);
  async function take(reel) {
    const before = film.length;
    await film.append(reel);
    tell();
    if (!before && film.length) { if (wanted) seek(Number(wanted[1])); else { time = film.start; play(true); } }
    if (waiting) { waiting = false; redraw(); }
    redraw();
  }
  if (first) await take(first);
  while (live) {
    const answer = await fetch(`${location.pathname.replace(/\/$/, "")}/reel?from=${film.length}`);
    if (!answer.ok) throw new Error(`the run cannot be read any more: ${answer.status}`);
    const { reel, camera: seen, done } = await answer.json();
    if (seen) { // what moves goes further than it had when the page was opened
      stage.camera = camera.from = seen;
      if (!camera.touched) camera.home();
      layGround();
    }
    if (reel) await take(reel);
    live = !done;
    if (live) await new Promise((wake) => setTimeout(wake, 200));
  }
  redraw();
}

function length(metres) {
  const short = (v) => String(Number(v.toPrecision(3)));
  return metres >= 1 ? `${short(metres)} m` : metres >= 0.001 ? `${short(1000 * metres)} mm` : `${short(1e6 * metres)} um`;
}

main().catch((error) => { byId("message").textContent = error.message; });
