// The 3-D scene: nodes by number as `drawing.py` describes them, from a websocket of its own.

import { listen, value } from "./channel.js";
import { decimals } from "./dom.js";

const SAID = 5000; // for which a file that was saved is named [ms]
const AGAIN = 1000; // pause before the next attempt to connect [ms]
const NOWHERE = { centre: [0, 0, 0], radius: 0.15, azimuth: -50, elevation: 30, floor: -0.05 };
const AXES = [0xd64045, 0x2a9d5c, 0x1f77b4]; // x, y, z
const WAY = 2000; // places of a path that are kept
const BALL = "/ball", TRAIL = 0.3, REST = 1e-6; // its node; time over which its speed is a mean [s]; speed that is none [m/s]
const SHRUNK = 3; // times that a force is below the one its arrows are scaled by before they are scaled again
const FAR = 2; // radii of the scene, beyond which nothing is followed: a ball that is lost falls for ever
const FOLLOWED = { "/ball": "ball", "/effector": "effector" };

const colour = (rgb) => new THREE.Color(...rgb.map((c) => c / 255));

// Draws nodes that come and go; each has a group, in that of its parent.
class LiveView extends View {
  // `labels`: element for texts; `hand`: called with what a hand does to the target.
  constructor(canvas, labels, changed, hand) {
    super(canvas, { camera: { ...NOWHERE }, bodies: [], pieces: [] }, null, changed);
    this.labels = labels;
    this.hand = hand;
    this.all = new Map();
    this.lined = true;
    this.followed = "";
    this.ballTrail = [];
    this.time = NaN; // simulated time of the bodies [s]
    this.way = null; // numbers of the path, if it is drawn
    this.saved = ""; // name of a picture that was just saved
    this.forces = false; // whether they are drawn
    this.plotted = false; // whether they are plotted
    this.recolour = false; // whether there are other values than those that were painted
    this.root = new THREE.Group();
    this.world = new THREE.Group();
    this.root.add(this.world);
    this.scene.add(this.root);
    this.layAxes();
  }

  // ---- nodes

  clear() { for (const number of [...this.all.keys()]) this.drop(number); }

  drop(number) {
    const node = this.all.get(number);
    this.all.delete(number);
    if (!node) return;
    if (node.kind === "field") this.recolour = true;
    if (node.kind === "arrows") this.point(`force ${node.name}`, [], [], node.colour, 1);
    node.group.removeFromParent();
    node.shadow?.removeFromParent();
    node.label?.remove();
    for (const control of node.controls ?? []) { control.detach(); control.getHelper().removeFromParent(); control.dispose(); }
    for (const made of node.made) made.dispose();
  }

  // Takes a message of the server; see `aim`.
  take(buffer, again) {
    const size = new DataView(buffer).getUint32(0, true), T = THREE;
    const head = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, size)));
    const floats = ([first, count]) => new T.BufferAttribute(new Float32Array(buffer, 4 + size + first, count), 3);
    const plain = ([first, count]) => new Float32Array(buffer, 4 + size + first, count);
    const whole = ([first, count]) => new T.BufferAttribute(new Uint32Array(buffer, 4 + size + first, count), 1);
    if (head.time < this.time) this.forgetForces(); // a reset
    if (head.alive) {
      const alive = new Set(head.alive);
      for (const number of [...this.all.keys()]) if (!alive.has(number)) this.drop(number);
    }
    for (const { number, vertices, triangles, values, points, vectors, rest: undeformed, ...rest } of head.nodes ?? []) {
      const node = this.all.get(number) ?? this.add(number, rest);
      Object.assign(node, rest);
      if (values) { node.values = plain(values); this.recolour = true; }
      if (points) node.points = plain(points);
      if (vectors) Object.assign(node, { vectors: plain(vectors), known: true });
      if (vertices) this.shape(node, floats(vertices), triangles && whole(triangles));
      if (undeformed) node.undeformed = floats(undeformed);
      if (rest.pose && !node.dragged) { node.group.position.fromArray(rest.pose); node.group.quaternion.fromArray(rest.pose, 3); }
      if ("visible" in rest) node.group.visible = rest.visible;
      if (rest.colour) for (const material of [node.material, node.faint]) if (material) material.color = colour(rest.colour);
      if ("turns" in rest) this.letTurn(node);
    }
    if ("time" in head) { this.time = head.time; this.followBall(); }
    if (head.camera) this.aim(head.camera, again);
  }

  add(number, { kind, parent, text, axes }) {
    const node = { group: new THREE.Group(), made: [], number, longest: 0, largest: 0 };
    (this.all.get(parent)?.group ?? this.root).add(node.group);
    if (kind === "group" && axes > 0) this.addAxes(node.group, axes);
    if (kind === "label") {
      node.label = document.createElement("span");
      node.label.textContent = text;
      this.labels.append(node.label);
    }
    if (kind === "handle") this.addHandle(node);
    this.all.set(number, node);
    return node;
  }

  // Gives a node vertices, and triangles where it has new ones.
  shape(node, vertices, triangles) {
    const T = THREE;
    if (node.kind === "points") { this.dots(node, vertices); return; }
    if (!node.geometry) {
      node.geometry = new T.BufferGeometry();
      node.made.push(node.geometry);
    }
    const old = node.geometry.attributes.position;
    if (old?.count === vertices.count) { old.array.set(vertices.array); old.needsUpdate = true; }
    else node.geometry.setAttribute("position", vertices.setUsage(T.DynamicDrawUsage));
    if (triangles) node.geometry.setIndex(triangles);
    if (node.body) return;
    if (node.kind === "lines") {
      node.material = new T.LineBasicMaterial();
      node.body = new T.LineSegments(node.geometry, node.material);
      node.body.frustumCulled = false;
      node.group.add(node.body);
      return;
    }
    node.material = this.material(node.colour);
    node.body = this.mesh(node.geometry, node.material, node.group);
    if (node.through) node.faint = this.seenThrough(node.geometry, node.colour, node.group).material;
    if (node.deforms) this.line(node); else node.made.push(this.edgesOf(node.geometry, node.group).geometry);
    node.shadow = this.shadow(node.geometry);
    node.shadow.matrixAutoUpdate = false;
    node.made.push(node.material);
  }

  // Points as small octahedra.
  dots(node, vertices) {
    const T = THREE, ends = [1, 0, 0, -1, 0, 0, 0, 1, 0, 0, -1, 0, 0, 0, 1, 0, 0, -1].map((v) => v * node.size);
    const geometry = new T.BufferGeometry().setAttribute("position", new T.BufferAttribute(new Float32Array(ends), 3));
    geometry.setIndex([0, 2, 4, 2, 1, 4, 1, 3, 4, 3, 0, 4, 2, 0, 5, 1, 2, 5, 3, 1, 5, 0, 3, 5]);
    const cloud = new T.InstancedMesh(geometry, this.material(node.colour), vertices.count), matrix = new T.Matrix4();
    cloud.frustumCulled = false;
    for (let i = 0; i < vertices.count; i++) cloud.setMatrixAt(i, matrix.setPosition(vertices.getX(i), vertices.getY(i), vertices.getZ(i)));
    node.group.add(cloud);
    node.made.push(geometry, cloud);
  }

  // Draws the lines of a mesh that deforms, each edge once; made when they are first seen.
  line(node) {
    if (!node.edges) {
      if (!this.lined) return;
      const sides = new Map(), index = node.geometry.index.array, count = node.geometry.attributes.position.count;
      for (let i = 0; i < index.length; i++) {
        const a = index[i], b = index[i % 3 === 2 ? i - 2 : i + 1];
        sides.set(Math.min(a, b) * count + Math.max(a, b), [a, b]);
      }
      const geometry = new THREE.BufferGeometry().setAttribute("position", node.geometry.attributes.position);
      geometry.setIndex([...sides.values()].flat());
      node.edges = this.meshLines(geometry, node.group);
      node.made.push(geometry);
    }
    node.edges.visible = this.lined;
  }

  showLines(shown) {
    this.lined = shown;
    for (const node of this.all.values()) if (node.deforms && node.body) this.line(node);
  }

  // ---- fields and forces

  uncover() {
    for (const { coat } of this.all.values()) if (coat) this.paint(coat, null);
    this.recolour = true;
  }

  // Bodies with the values of a field, for `Colours`.
  valued(field) {
    const found = [];
    for (const { kind, path, parent, values } of this.all.values()) {
      const node = kind === "field" && path.endsWith(`/${field}`) && this.all.get(parent);
      if (!node?.body || node.geometry.attributes.position.count !== values.length) continue;
      if (!node.coat) {
        node.coat = { mesh: node.body, geometry: node.geometry, plain: node.material };
        node.made.push({ dispose: () => node.coat.painted?.dispose() });
      }
      found.push([node.coat, values, node.number]);
    }
    return found;
  }

  // Values of the fields that are shown at a node of a body, each [name of the field, value].
  fieldsAt(part, node) {
    return [...this.all.values()].filter(({ kind, parent, values }) => kind === "field" && parent === part && node < values?.length)
      .map(({ path, values }) => [path.split("/").pop(), values[node]]);
  }

  // Groups of forces, each with its `largest` now and the `longest` by which its arrows are scaled.
  groups() {
    return [...this.all.values()].filter(({ kind, points, vectors }) => kind === "arrows" && points?.length === vectors?.length);
  }

  // Draws the groups of forces that are wanted.
  lay() {
    const groups = this.groups();
    for (const node of this.all.values()) {
      if (node.kind !== "arrows") continue;
      const { name, points, vectors, colour } = node, on = this.forces && this.wants(name) && points.length === vectors.length;
      this.point(`force ${name}`, on ? points : [], on ? vectors : [], colour, this.scaleOf(node, groups));
    }
  }

  // Finds the largest force of each group. The scale follows it, and stays while it is a little smaller.
  measure() {
    for (const node of this.groups()) {
      const { vectors } = node;
      node.largest = node.known ? 0 : NaN;
      for (let i = 0; i < vectors.length; i += 3) node.largest = Math.max(node.largest, Math.hypot(vectors[i], vectors[i + 1], vectors[i + 2]));
      if (node.largest > node.longest || (node.largest > 0 && node.largest * SHRUNK < node.longest)) node.longest = node.largest;
    }
  }

  // Forgets the forces until others are told.
  forgetForces() {
    for (const node of this.all.values()) if (node.kind === "arrows") {
      Object.assign(node, { longest: 0, known: false, points: [], vectors: [] });
    }
  }

  showForces(on) {
    this.forces = on;
    for (const node of this.all.values()) node.longest = 0;
  }

  addAxes(group, length) {
    const T = THREE;
    AXES.forEach((shade, k) => {
      const axis = new T.CylinderGeometry(0.02 * length, 0.02 * length, length, 8).translate(0, length / 2, 0);
      if (k === 0) axis.rotateZ(-Math.PI / 2);
      if (k === 2) axis.rotateX(Math.PI / 2);
      this.mesh(axis, new T.MeshLambertMaterial({ color: shade }), group);
    });
  }

  // The axes of the world, on the floor.
  layAxes() {
    if (!this.world) return; // not made yet
    const { centre, radius, floor } = this.stage.camera, size = 0.16 * radius;
    for (const part of [...this.world.children]) { part.removeFromParent(); part.geometry?.dispose(); }
    this.addAxes(this.world, size);
    this.world.position.set(centre[0] - 0.1 * radius, centre[1] - 0.75 * radius, floor);
    this.tips ??= ["x", "y", "z"].map((name) => {
      const label = document.createElement("span");
      label.textContent = name;
      this.labels.append(label);
      return { label, group: new THREE.Group() };
    });
    this.tips.forEach(({ group }, k) => {
      this.world.add(group);
      group.position.setComponent(k, 1.15 * size);
    });
  }

  layFloor() {
    super.layFloor();
    this.layAxes();
  }

  // ---- the target

  addHandle(node) {
    const make = (mode, size) => {
      const control = new THREE.TransformControls(this.camera, this.canvas);
      control.setMode(mode);
      control.setSize(size);
      control.attach(node.group);
      this.scene.add(control.getHelper());
      control.addEventListener("change", () => this.changed());
      control.addEventListener("axis-changed", ({ value: axis }) => {
        if (!control.dragging) this.controls.enableRotate = this.controls.enablePan = !axis; // the wheel zooms there, too
        this.canvas.style.cursor = axis ? "move" : "";
      });
      control.addEventListener("dragging-changed", ({ value: dragging }) => {
        node.dragged = dragging;
        this.controls.enabled = !dragging;
        for (const other of node.controls) if (other !== control) other.enabled = !dragging && this.works(node, other);
        this.hand(dragging ? { grab: true } : { drop: true });
      });
      control.addEventListener("objectChange", () =>
        this.hand({ drag: node.group.position.toArray(), turn: node.group.quaternion.toArray() }));
      return control;
    };
    node.controls = [make("translate", 0.6), make("rotate", 0.85)];
  }

  works(node, control) { return this.isSeen(node.group) && (control.mode === "translate" || node.turns); }

  letTurn(node) { if (!node.turns) node.group.quaternion.set(0, 0, 0, 1); }

  // ---- the camera

  // `again`: the connection was lost meanwhile, so all is sent again.
  aim({ fit, ...camera }, again) {
    this.stage.camera = camera;
    if ((fit && !again) || !this.touched) this.home(); else this.layFloor();
  }

  home() {
    if (!this.follows || this.gone) this.origin = [...this.stage.camera.centre];
    super.home();
  }

  // Lets the camera go along with the node of a path; "": it stands still.
  follow(path) {
    this.followed = path;
    this.follows = Boolean(path);
    if (!path) return;
    this.camera.position.sub(this.controls.target);
    this.controls.target.set(0, 0, 0);
    this.touched = true;
  }

  // Goes along to a place; while that is far from the scene, to the middle of the scene.
  accompany(place) {
    const { centre, radius } = this.stage.camera, gone = Math.hypot(...place.map((v, a) => v - centre[a])) > FAR * radius;
    if (this.gone && !gone) this.follow(this.followed);
    this.gone = gone;
    this.origin = gone ? [...centre] : place;
  }

  node(path) { return [...this.all.values()].find((node) => node.path === path); }

  isSeen(group) {
    for (let at = group; at; at = at.parent) if (!at.visible) return false;
    return true;
  }

  bounds() {
    const T = THREE, box = new T.Box3(), point = new T.Vector3();
    this.root.updateMatrixWorld();
    for (const { fits, body, geometry, group } of this.all.values()) {
      if (!fits || !body || !this.isSeen(group)) continue;
      const { position } = geometry.attributes;
      for (let i = 0; i < position.count; i++) box.expandByPoint(point.fromBufferAttribute(position, i).applyMatrix4(group.matrixWorld));
    }
    return box;
  }

  targets() { return this.solids().filter(({ name }) => name); }

  // All that has a surface, with a name or not, see `targets`.
  solids() {
    return [...this.all.values()].filter(({ kind, body, group }) => body && kind !== "lines" && this.isSeen(group))
      .map(({ number, name, first, body, geometry }) => ({ part: number, name, first, mesh: body, geometry }));
  }

  // Where a node of a soft body is in the undeformed body [m], or null.
  rest(part, node) {
    const { undeformed } = this.all.get(part) ?? {};
    return node < undeformed?.count ? [undeformed.getX(node), undeformed.getY(node), undeformed.getZ(node)] : null;
  }

  // Length of the shortest edge at a node of a soft body, undeformed [m].
  edge(part, node) {
    const { geometry, undeformed } = this.all.get(part), { array } = geometry.index, T = THREE;
    const [here, there] = [new T.Vector3().fromBufferAttribute(undeformed, node), new T.Vector3()];
    let shortest = Infinity;
    for (let i = 0; i < array.length; i++) {
      const corners = [0, 1, 2].map((c) => array[i - i % 3 + c]);
      if (array[i] !== node && corners.includes(node)) shortest = Math.min(shortest, there.fromBufferAttribute(undeformed, array[i]).distanceTo(here));
    }
    return shortest;
  }

  // Where what has a path is [m], or null.
  placeOf(path) {
    const node = this.node(path);
    return node && this.isSeen(node.group) ? node.group.position.toArray() : null;
  }

  // ---- the ball

  // Keeps where the ball was in the last `TRAIL` seconds.
  followBall() {
    const place = this.placeOf(BALL), last = this.ballTrail.at(-1);
    if (!place || this.time < last?.time) this.ballTrail.length = 0;
    if (place) this.ballTrail.push({ place, time: this.time });
    while (this.time - this.ballTrail[1]?.time > TRAIL) this.ballTrail.shift();
  }

  isBall(part) { return this.all.get(part)?.path.startsWith(`${BALL}/`) ?? false; }

  // What is known of the ball: place [m], mean speed of the last moment [m/s], contact force [N], NaN where that is not.
  ball() {
    const first = this.ballTrail[0], last = this.ballTrail.at(-1), force = [0, 0, 0], of = this.groups().filter(({ name, known }) => known && name.includes(" on ball by "));
    for (const { vectors } of of) vectors.forEach((v, i) => { force[i % 3] += v; });
    const speed = last?.time > first?.time ? Math.hypot(...last.place.map((v, a) => v - first.place[a])) / (last.time - first.time) : NaN;
    return { place: this.placeOf(BALL), speed: speed < REST ? 0 : speed, force: of.length ? Math.hypot(...force) : NaN };
  }

  // ---- the path of what is followed, the ball or the effector

  showPath(shown) { this.way = shown ? [] : null; this.trail([]); }

  walk() {
    const path = [this.followed, ...Object.keys(FOLLOWED)].find((one) => one && this.placeOf(one));
    if (path !== this.walker) [this.walker, this.way] = [path, []];
    const place = path && this.placeOf(path), far = place && place.map((v, a) => v - (this.way.at(a - 3) ?? Infinity));
    if (place && !(Math.hypot(...far) < 1e-3 * this.stage.camera.radius)) this.way.push(...place);
    if (this.way.length > 3 * WAY) this.way.splice(0, 3);
    this.trail(this.way);
  }

  // ---- drawing

  render() {
    if (this.way) this.walk();
    const followed = this.followed && this.node(this.followed);
    if (followed) this.accompany(followed.group.position.toArray());
    this.root.position.set(...this.origin.map((v) => -v));
    this.lay();
    this.root.updateMatrixWorld();
    for (const { group, shadow, controls } of this.all.values()) {
      if (shadow) {
        shadow.visible = this.isSeen(group);
        shadow.matrix.copy(group.matrixWorld);
      }
    }
    for (const node of this.all.values()) for (const control of node.controls ?? []) {
      const works = this.works(node, control);
      control.getHelper().visible = works;
      if (!control.dragging) control.enabled = works && !node.controls.some((other) => other.dragging);
    }
    super.render();
    this.write();
  }

  // Labels that are seen, where their nodes are.
  *captions() {
    const { clientWidth: w, clientHeight: h } = this.canvas, at = new THREE.Vector3();
    for (const { label, group } of [...this.all.values(), ...this.tips]) {
      if (!label) continue;
      at.setFromMatrixPosition(group.matrixWorld).project(this.camera);
      const seen = at.z < 1 && this.isSeen(group);
      label.style.display = seen ? "" : "none";
      if (seen) yield [label, 0.5 * w * (1 + at.x), 0.5 * h * (1 - at.y)];
    }
  }

  write() {
    for (const [label, x, y] of this.captions()) label.style.transform = `translate(${x}px, ${y}px) translate(-50%, -130%)`;
  }
}

// By the fields of the simulation.
class LiveColours extends Colours {
  update() {
    if (!this.chosen) return;
    if (!this.view.recolour) { this.mark(); return; }
    this.view.recolour = false;
    const parts = this.view.valued(this.chosen);
    if (parts.length) { this.paint(parts); return; }
    this.view.uncover();
    this.find([]);
    this.view.recolour = false;
    byId("legend-title").textContent = this.label;
    this.note((value("replay")?.age ?? null) === null ? "waiting for values" : "the replay does not have it");
  }
}

// Shows the scene; returns its view, or null where the browser cannot draw.
export function scene() {
  let asked = 0, socket = null, view;
  const pending = []; // messages that are not drawn yet
  const redraw = () => { if (!asked) asked = requestAnimationFrame(paint); };
  const hand = (event) => { if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify(event)); };
  try {
    view = new LiveView(byId("picture"), byId("labels"), redraw, hand);
  } catch (error) {
    console.info(error.message);
    return null;
  }

  let colours = null;
  const boxes = new ForceBoxes(byId("arrows"), true, view, redraw);
  view.wants = (name) => boxes.has(name);
  // Says what this page shows: the simulator computes nothing else, and nothing for a page that is hidden.
  const tell = () => hand({ show: document.hidden ? "" : colours?.chosen ?? "", forces: !document.hidden && (view.forces || view.plotted) });
  view.plotForces = (on) => {
    if (view.plotted === on) return;
    view.plotted = on;
    tell();
  };
  const offer = () => {
    const maps = value("maps"), fields = value("fields");
    if (!maps || !fields) return;
    colours ??= new LiveColours(view, maps, () => { view.recolour = true; tell(); redraw(); });
    const before = colours.chosen;
    colours.offer(new Map(fields.map((field) => [field.name, field])));
    if (colours.chosen !== before) tell();
  };
  listen("maps", offer);
  listen("fields", offer);
  listen("run", () => { if (view.forces) redraw(); });
  document.addEventListener("visibilitychange", tell);

  function paint() {
    asked = 0;
    for (const { from, data, first } of pending.splice(0)) {
      if (from !== socket) continue;
      const again = first && view.all.size > 0;
      if (first) view.clear();
      view.take(data, again);
      hand({ took: true }); // a page that is hidden is not painted: it is sent nothing more
    }
    colours?.update();
    view.measure();
    const groups = view.forces ? view.groups() : [], waits = view.forces && !groups.some(({ known }) => known) && value("run")?.state === 1;
    boxes.offer(groups, waits ? "forces are known after the next step" : "");
    view.render();
    byId("scale").textContent = view.saved ? `saved as ${view.saved}` : `one square of the floor: ${length(view.cell)}`;
    offerFollow(view);
  }

  function open() {
    const folder = new URL(".", import.meta.url); // ends in /TOKEN/page/
    const own = new WebSocket(`ws://${folder.host}${folder.pathname}scene`);
    let first = true;
    socket = own;
    own.binaryType = "arraybuffer";
    own.addEventListener("open", tell);
    own.addEventListener("message", ({ data }) => {
      pending.push({ from: own, data, first });
      first = false;
      redraw();
    });
    own.addEventListener("close", () => setTimeout(open, AGAIN));
  }

  open();
  addEventListener("resize", redraw);
  new ResizeObserver(redraw).observe(byId("stage"));
  tools(view, redraw, tell, () => [colours?.key, boxes.lines]);
  return view;
}

// Lets what is there be followed.
function offerFollow(view) {
  const select = byId("follow"), there = ["", ...Object.keys(FOLLOWED).filter((path) => view.node(path)?.group.visible)];
  select.parentElement.hidden = byId("path").hidden = there.length === 1;
  if (select.length === there.length && there.every((path, i) => select.options[i].value === path)) return;
  const chosen = there.includes(select.value) ? select.value : "";
  select.replaceChildren();
  for (const path of there) option(select, path, path ? `follow ${FOLLOWED[path]}` : "stand still");
  select.value = chosen;
  if (view.followed !== chosen) view.follow(chosen);
}

function tools(view, redraw, tell, legend) {
  const then = (act) => () => { act(); redraw(); };
  const all = (actions) => Object.fromEntries(Object.entries(actions).map(([name, act]) => [name, then(act)]));
  const cameras = all(cameraActions(view));
  const more = all({
    lines: () => { view.showLines(!view.lined); pressed("lines", view.lined); },
    path: () => { view.showPath(!view.way); pressed("path", Boolean(view.way)); },
    shot: async () => {
      const name = value("scene")?.name || "tripod", run = value("run");
      view.saved = save(`${name}.png`, await view.screenshot(BACKGROUND, [run ? `${name}, ${run.time.toFixed(decimals(run.dt))} s` : name], ...legend()));
      redraw();
      setTimeout(() => { view.saved = ""; redraw(); }, SAID);
    },
    forces: () => { view.showForces(!view.forces); pressed("forces", view.forces); tell(); },
    aside: () => pressed("aside", !document.body.classList.toggle("wide")),
    help: () => toggleSheet(false), // STOP works on
  });
  const keys = { home: "r", fit: "f", front: "w", side: "s", lines: "l", path: "c", aside: "h", help: "?" };
  addTools(byId("camera-tools"), cameras, keys);
  addTools(byId("page-tools"), more, keys);
  pressed("lines", view.lined);
  byId("follow").addEventListener("change", then(() => {
    view.follow(byId("follow").value);
    byId("follow").blur(); // arrows move joints again
  }));
  splitAt(byId("split"), (width) => document.body.style.setProperty("--width", `${width}px`));
  addEventListener("keydown", (event) => { // those that the servos do not have
    if (event.ctrlKey || event.altKey || event.metaKey || /^(INPUT|SELECT)$/.test(event.target.tagName)) return;
    const name = Object.keys(keys).find((one) => keys[one] === event.key);
    if (name) { event.preventDefault(); ({ ...cameras, ...more })[name](); }
  });
}
