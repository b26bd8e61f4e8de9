"use strict";
// Draws a scene: bodies that deform, pieces that keep their shape, the floor, colours and arrows. Metres, z up.
//
// All is drawn relative to `origin`, a point of the world, so that single precision is enough far away from zero.

const HALF_ANGLE = 0.3; // half the angle of view [rad]
const NONE = [176, 176, 176]; // colour of a value that is missing
const ARROW_SHARE = 0.4; // length of the longest arrow over the radius of the scene
const MARK = [[4, 9, 0xffffff], [5.5, 7.5, 0x111111]]; // rings about a marked point: radii [px], colour
const ROUNDING = 1e-5; // of the longest arrow of its unit: what is shorter is none
const CREASE = 40; // angle between faces whose common edge is drawn, of pieces [degrees]
const NARROW = 600, LEGEND_SHARE = 0.5; // of a saved picture: width of one with smaller letters [px]; share of its legend
const VIEWS = { front: [-90, 0], side: [0, 0], top: [-90, 90] }; // azimuth and elevation of the eye [degrees]

// A text as lines that are not wider than `room`.
function wrapped(pen, text, room) {
  const lines = [];
  for (const word of text.split(" ")) {
    const longer = lines.length ? `${lines.at(-1)} ${word}` : word;
    if (lines.length && pen.measureText(longer).width <= room) lines[lines.length - 1] = longer; else lines.push(word);
  }
  return lines;
}

// Spreads a table of colours, each [r, g, b] of 0 to 255, evenly to 256.
function spread(table) {
  const out = new Uint8Array(3 * 256);
  for (let i = 0; i < 256; i++) {
    const at = i / 255 * (table.length - 1), k = Math.min(Math.floor(at), table.length - 2), w = at - k;
    for (let c = 0; c < 3; c++) out[3 * i + c] = Math.round((1 - w) * table[k][c] + w * table[k + 1][c]);
  }
  return out;
}

class View {
  // `canvas`: drawn on. `stage`: what there is, see packing.py; `read`: returns an array of it. `changed`: called when
  // the user moved the camera. Throws where the browser has no WebGL 2.
  constructor(canvas, stage, read, changed) {
    const T = THREE;
    T.ColorManagement.enabled = false;
    this.canvas = canvas;
    this.stage = stage;
    this.changed = changed;
    this.origin = [...stage.camera.centre];
    this.renderer = new T.WebGLRenderer({ canvas, antialias: true, alpha: true, stencil: true });
    this.renderer.outputColorSpace = T.LinearSRGBColorSpace;
    this.renderer.setClearColor(0, 0);
    this.scene = new T.Scene();
    this.camera = new T.PerspectiveCamera(2 * HALF_ANGLE * 180 / Math.PI, 1, 0.01, 100);
    this.camera.up.set(0, 0, 1);
    this.light();
    this.shadows = new T.Group();
    this.shadows.matrixAutoUpdate = false;
    this.scene.add(this.shadows);
    this.bodies = stage.bodies.map((body) => this.addBody(body, read));
    this.pieces = stage.pieces.map((piece) => this.addPiece(piece, read));
    this.arrows = new Map();
    this.controls = new T.OrbitControls(this.camera, canvas);
    this.controls.enableDamping = false;
    this.controls.zoomToCursor = true;
    this.controls.addEventListener("start", () => { this.touched = true; });
    this.controls.addEventListener("change", () => this.moved());
    this.below = false;
    this.home();
  }

  // ---- what there is

  light() {
    const T = THREE, add = (light, x, y, z) => { light.position.set(x, y, z); this.scene.add(light); };
    add(new T.HemisphereLight(0xffffff, 0x9aa0a6, 1.9), 0, 0, 1);
    add(new T.DirectionalLight(0xffffff, 1.25), 0.6, -0.3, 1);
    add(new T.DirectionalLight(0xffffff, 0.4), -0.6, 0.7, 0.3);
  }

  material(colour, more = {}) {
    return new THREE.MeshLambertMaterial({ color: new THREE.Color(...colour.map((c) => c / 255)), flatShading: true,
      side: THREE.DoubleSide, polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1, ...more });
  }

  mesh(geometry, material, parent = this.scene) {
    const mesh = new THREE.Mesh(geometry, material);
    mesh.frustumCulled = false;
    parent.add(mesh);
    return mesh;
  }

  shadow(geometry) {
    this.shade ??= new THREE.MeshBasicMaterial({ color: 0x28323c, transparent: true, opacity: 0.13, depthWrite: false,
      side: THREE.DoubleSide, stencilWrite: true, stencilFunc: THREE.EqualStencilFunc,
      stencilZPass: THREE.IncrementStencilOp });
    return this.mesh(geometry, this.shade, this.shadows);
  }

  // What is hidden behind others, faintly.
  seenThrough(geometry, colour, parent = this.scene) {
    const faint = this.material(colour, { transparent: true, opacity: 0.35, depthTest: false, depthWrite: false });
    const mesh = this.mesh(geometry, faint, parent);
    mesh.renderOrder = 2;
    return mesh;
  }

  edgesOf(geometry, parent) {
    this.creases ??= new THREE.LineBasicMaterial({ color: 0x222a30, transparent: true, opacity: 0.45 });
    const edges = new THREE.LineSegments(new THREE.EdgesGeometry(geometry, CREASE), this.creases);
    edges.frustumCulled = false;
    parent.add(edges);
    return edges;
  }

  meshLines(geometry, parent = this.scene) {
    const lines = new THREE.LineSegments(geometry, new THREE.LineBasicMaterial({ color: 0x3c230f, transparent: true, opacity: 0.55 }));
    lines.frustumCulled = false;
    parent.add(lines);
    return lines;
  }

  addBody(body, read) {
    const T = THREE, geometry = new T.BufferGeometry(), triangles = read(body.triangles);
    const positions = new T.BufferAttribute(new Float32Array(3 * body.nodes), 3).setUsage(T.DynamicDrawUsage);
    geometry.setAttribute("position", positions);
    geometry.setIndex(new T.BufferAttribute(triangles, 1));
    const edges = new T.BufferGeometry();
    edges.setAttribute("position", positions);
    edges.setIndex(new T.BufferAttribute(read(body.edges), 1));
    const lines = this.meshLines(edges);
    lines.visible = false;
    const made = { geometry, positions, triangles, lines, plain: this.material(body.colour) };
    made.mesh = this.mesh(geometry, made.plain);
    if (body.through) this.seenThrough(geometry, body.colour);
    made.shadow = this.shadow(geometry);
    return made;
  }

  addPiece(piece, read) {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(read(piece.vertices), 3));
    geometry.setIndex(new THREE.BufferAttribute(read(piece.triangles), 1));
    const made = { geometry, mesh: this.mesh(geometry, this.material(piece.colour)), shadow: this.shadow(geometry) };
    this.edgesOf(geometry, made.mesh);
    for (const mesh of [made.mesh, made.shadow]) mesh.matrixAutoUpdate = false;
    return made;
  }

  // ---- one picture

  // Coordinates of the nodes of body b relative to `origin`, to be written before `update`.
  nodes(b) { return this.bodies[b].positions.array; }

  update(b) { this.bodies[b].positions.needsUpdate = true; }

  // Places piece p: position and quaternion x, y, z, w in the world; null: it is not there.
  place(p, pose) {
    const { mesh, shadow } = this.pieces[p];
    mesh.visible = shadow.visible = Boolean(pose);
    if (!pose) return;
    const T = THREE, at = new T.Vector3(...[0, 1, 2].map((a) => pose[a] - this.origin[a]));
    mesh.matrix.compose(at, new T.Quaternion(...pose.slice(3)), new T.Vector3(1, 1, 1));
    shadow.matrix.copy(mesh.matrix);
  }

  // Lets all bodies have their own colours.
  uncover() { for (const body of this.bodies) this.paint(body, null); }

  // Colours a body {mesh, geometry, plain} by a number for each node, from `low` to `high`; without `values` it has its
  // own colour, that of `plain`.
  paint(body, values, low, high, map) {
    if (!values) { body.mesh.material = body.plain; return; }
    if (!body.colours) {
      body.colours = new THREE.BufferAttribute(new Uint8Array(4 * values.length), 4, true).setUsage(THREE.DynamicDrawUsage);
      body.geometry.setAttribute("color", body.colours);
      body.painted = this.material([255, 255, 255], { vertexColors: true });
    }
    body.mesh.material = body.painted;
    const out = body.colours.array, scale = high > low ? 255 / (high - low) : 0;
    for (let i = 0; i < values.length; i++) {
      const v = values[i], at = v === v ? 3 * Math.min(255, Math.max(0, Math.round((v - low) * scale))) : -1;
      for (let c = 0; c < 3; c++) out[4 * i + c] = at < 0 ? NONE[c] : map[at + c];
      out[4 * i + 3] = 255;
    }
    body.colours.needsUpdate = true;
  }

  // Draws arrows named `name`: from `points`, along `vectors`, both of 3 numbers each; `scale`: metres of a unit.
  point(name, points, vectors, colour, scale) {
    const T = THREE, count = points.length / 3;
    let made = this.arrows.get(name);
    if (!made || made.room < count) {
      if (made) { this.scene.remove(made.shafts, made.heads); made.shafts.dispose(); made.heads.dispose(); }
      const room = Math.max(16, 2 * count), material = new T.MeshLambertMaterial({ color: new T.Color(...colour.map((c) => c / 255)),
        depthTest: false, transparent: true });
      const up = (geometry, height) => geometry.rotateX(Math.PI / 2).translate(0, 0, height / 2);
      made = { room, shafts: new T.InstancedMesh(up(new T.CylinderGeometry(1, 1, 1, 10), 1), material, room),
        heads: new T.InstancedMesh(up(new T.ConeGeometry(1, 1, 14), 1), material, room) };
      for (const part of [made.shafts, made.heads]) { part.frustumCulled = false; part.renderOrder = 3; this.scene.add(part); }
      this.arrows.set(name, made);
    }
    const matrix = new T.Matrix4(), turn = new T.Quaternion(), z = new T.Vector3(0, 0, 1), way = new T.Vector3();
    const at = new T.Vector3(), size = new T.Vector3(), thick = 0.012 * this.stage.camera.radius;
    let drawn = 0;
    for (let i = 0; i < count; i++) {
      way.set(vectors[3 * i], vectors[3 * i + 1], vectors[3 * i + 2]);
      const length = way.length() * scale;
      if (!(length > 0.5 * thick)) continue;
      turn.setFromUnitVectors(z, way.normalize());
      const head = Math.min(length, 5 * thick);
      at.set(points[3 * i] - this.origin[0], points[3 * i + 1] - this.origin[1], points[3 * i + 2] - this.origin[2]);
      made.shafts.setMatrixAt(drawn, matrix.compose(at, turn, size.set(thick, thick, Math.max(length - head, 1e-9))));
      at.addScaledVector(way, length - head);
      made.heads.setMatrixAt(drawn++, matrix.compose(at, turn, size.set(2.2 * thick, 2.2 * thick, head)));
    }
    for (const part of [made.shafts, made.heads]) { part.count = drawn; part.instanceMatrix.needsUpdate = true; }
  }

  // Draws the way of something, through points of the world, 3 numbers each; none: nothing.
  trail(points) {
    const T = THREE;
    if (!this.path) {
      this.path = new T.Line(new T.BufferGeometry(), new T.LineBasicMaterial({ color: 0xc2185b, depthTest: false, transparent: true }));
      this.path.frustumCulled = false;
      this.path.renderOrder = 3;
      this.scene.add(this.path);
    }
    if (!(this.path.room >= points.length)) {
      this.path.geometry.dispose();
      this.path.room = 2 * points.length;
      this.path.geometry = new T.BufferGeometry().setAttribute("position", new T.BufferAttribute(new Float32Array(this.path.room), 3));
    }
    this.path.geometry.setDrawRange(0, points.length / 3);
    const { position } = this.path.geometry.attributes;
    for (let i = 0; i < points.length; i++) position.array[i] = points[i] - this.origin[i % 3];
    position.needsUpdate = true;
    this.path.visible = points.length > 3;
  }

  // Marks a place of the world by a ring that is always seen; null: none.
  mark(place) {
    this.marked = place;
    if (!place && !this.ring) return;
    this.ring ??= this.makeRing();
    this.ring.visible = Boolean(place);
  }

  makeRing() {
    const T = THREE, ring = new T.Group(), corners = 32;
    for (const [inner, outer, shade] of MARK) {
      const ends = [], faces = [];
      for (let i = 0; i < corners; i++) {
        const turn = 2 * Math.PI * i / corners, [a, b, c, d] = [2 * i, 2 * i + 1, (2 * i + 2) % (2 * corners), (2 * i + 3) % (2 * corners)];
        for (const r of [inner, outer]) ends.push(r * Math.cos(turn), r * Math.sin(turn), 0);
        faces.push(a, b, c, c, b, d);
      }
      const geometry = new T.BufferGeometry().setAttribute("position", new T.BufferAttribute(new Float32Array(ends), 3));
      geometry.setIndex(faces);
      const material = new T.MeshBasicMaterial({ color: shade, depthTest: false, transparent: true, side: T.DoubleSide });
      this.mesh(geometry, material, ring).renderOrder = 4;
    }
    this.scene.add(ring);
    return ring;
  }

  // Keeps the ring as large on the screen as it is.
  placeRing(height) {
    if (!this.marked || !this.ring) return;
    const { position, quaternion, scale } = this.ring, { camera } = this;
    position.set(...this.marked.map((v, a) => v - this.origin[a]));
    quaternion.copy(camera.quaternion);
    const deep = position.clone().sub(camera.position).dot(camera.getWorldDirection(new THREE.Vector3()));
    scale.setScalar(2 * Math.max(deep, 0) * Math.tan(HALF_ANGLE) / height);
  }

  // Metres of a unit at which the longest arrow, of `longest` units, is well seen.
  arrowScale(longest) { return longest > 0 ? ARROW_SHARE * this.stage.camera.radius / longest : 0; }

  // The same of a group of `groups`; 0 where its longest arrow is rounding beside those of its unit.
  scaleOf(group, groups) {
    const most = Math.max(...groups.filter(({ unit }) => unit === group.unit).map(({ longest }) => longest));
    return group.longest < ROUNDING * most ? 0 : this.arrowScale(group.longest);
  }

  showLines(shown) { for (const { lines } of this.bodies) lines.visible = shown; }

  // ---- the floor

  layFloor() {
    const { radius, centre, floor } = this.stage.camera, T = THREE;
    const power = 10 ** Math.floor(Math.log10(radius)), cell = power * (radius / power > 4 ? 1 : 0.2);
    const count = Math.ceil(2.5 * radius / cell), reach = count * cell, ends = [];
    for (let i = -count; i <= count; i++) ends.push(i * cell, -reach, 0, i * cell, reach, 0, -reach, i * cell, 0, reach, i * cell, 0);
    if (this.floor) { this.scene.remove(this.floor); this.floor.geometry.dispose(); }
    const geometry = new T.BufferGeometry().setAttribute("position", new T.BufferAttribute(new Float32Array(ends), 3));
    this.floor = new T.LineSegments(geometry, new T.LineBasicMaterial({ color: 0x788796, transparent: true, opacity: 0.35 }));
    this.floor.frustumCulled = false;
    this.scene.add(this.floor);
    this.cell = cell;
    this.floorAt = [Math.round(centre[0] / cell) * cell, Math.round(centre[1] / cell) * cell, floor];
  }

  // ---- the camera

  // Takes the camera of another stage: what moves goes further than it had.
  widen(camera) {
    this.stage.camera = camera;
    if (!this.touched) this.home(); else this.layFloor();
  }

  home() {
    const { azimuth, elevation, radius } = this.stage.camera;
    this.touched = false;
    this.layFloor();
    this.look(azimuth, elevation, radius, [0, 0, 0]);
  }

  // Looks at `target` from an azimuth and elevation [degrees], so that a ball of `radius` about it is seen.
  look(azimuth, elevation, radius = this.radius, target = this.controls.target.toArray()) {
    const a = azimuth * Math.PI / 180, e = Math.min(elevation, 89.99) * Math.PI / 180, aspect = this.aspect;
    const distance = radius / Math.sin(HALF_ANGLE) / Math.min(1, aspect);
    this.radius = radius;
    this.controls.minDistance = 0.02 * this.stage.camera.radius;
    this.controls.maxDistance = 200 * this.stage.camera.radius;
    this.controls.target.set(...target);
    this.camera.position.set(Math.cos(e) * Math.cos(a), Math.cos(e) * Math.sin(a), Math.sin(e)).multiplyScalar(distance)
      .add(this.controls.target);
    this.moved();
    this.controls.update();
  }

  // Looks from the front, the side or the top at what is looked at now.
  from(name) { this.touched = true; this.look(...VIEWS[name], this.seen); }

  // The box about all bodies and pieces as they are now, relative to `origin`.
  bounds() {
    const T = THREE, box = new T.Box3(), point = new T.Vector3();
    this.bodies.forEach(({ positions }, b) => {
      if (!this.stage.bodies[b].seen) return;
      for (let i = 0; i < positions.count; i++) box.expandByPoint(point.fromBufferAttribute(positions, i));
    });
    this.pieces.forEach(({ mesh, geometry }, p) => {
      if (!mesh.visible || (!this.stage.pieces[p].moves && !box.isEmpty())) return;
      geometry.computeBoundingBox();
      box.union(geometry.boundingBox.clone().applyMatrix4(mesh.matrix));
    });
    return box;
  }

  // Shows all as it is now, from where the camera stands.
  fit() {
    const T = THREE, box = this.bounds();
    if (box.isEmpty()) return;
    const way = this.camera.position.clone().sub(this.controls.target).normalize(), ball = box.getBoundingSphere(new T.Sphere());
    this.touched = true;
    const elevation = Math.asin(way.z) * 180 / Math.PI, azimuth = Math.atan2(way.y, way.x) * 180 / Math.PI;
    this.look(azimuth, elevation, Math.max(ball.radius, 1e-6), ball.center.toArray());
  }

  get aspect() { return this.canvas.clientWidth / this.canvas.clientHeight || 1; }

  // Radius of what is seen now.
  get seen() {
    return this.camera.position.distanceTo(this.controls.target) * Math.sin(HALF_ANGLE) * Math.min(1, this.aspect);
  }

  // Keeps the eye above the floor.
  moved() {
    const target = this.controls.target, distance = this.camera.position.distanceTo(target) || 1;
    const above = (this.floorAt[2] - this.origin[2] + 0.01 * distance - target.z) / distance;
    const low = this.below ? Math.PI : Math.acos(Math.min(0.999, Math.max(-1, above)));
    if (this.controls.maxPolarAngle !== low) { this.controls.maxPolarAngle = low; this.controls.update(); }
    this.changed();
  }

  // ---- drawing

  render() {
    const ratio = Math.min(window.devicePixelRatio || 1, 2), w = this.canvas.clientWidth, h = this.canvas.clientHeight;
    if (!w || !h) return;
    if (this.width !== w || this.height !== h || this.ratio !== ratio) {
      if (this.width && !this.touched) { Object.assign(this, { width: w, height: h, ratio }); this.home(); }
      Object.assign(this, { width: w, height: h, ratio });
      this.renderer.setPixelRatio(ratio);
      this.renderer.setSize(w, h, false);
    }
    const camera = this.camera, distance = camera.position.distanceTo(this.controls.target);
    Object.assign(camera, { aspect: w / h, near: 0.02 * distance, far: 60 * distance });
    camera.updateProjectionMatrix();
    const z = this.stage.camera.floor - this.origin[2], slide = 0.25;
    const along = this.follows ? [0, 1].map((a) => Math.round((this.origin[a] - this.stage.camera.centre[a]) / this.cell) * this.cell) : [0, 0];
    this.floor.position.set(...[0, 1].map((a) => this.floorAt[a] + along[a] - this.origin[a]), z);
    // what is above the floor falls onto it along the light
    this.shadows.matrix.set(1, 0, -0.6 * slide, 0.6 * slide * z, 0, 1, 0.3 * slide, -0.3 * slide * z, 0, 0, 0, z, 0, 0, 0, 1);
    this.shadows.visible = camera.position.z > z;
    this.before?.();
    this.placeRing(h);
    this.renderer.render(this.scene, camera);
  }

  // Looks at vertex `node` of a part, from where it is seen.
  lookAt(part, node) {
    const T = THREE, target = this.targets().find((one) => one.part === part), place = this.vertex(part, node);
    if (!place) return;
    const middle = new T.Vector3(...place.map((v, a) => v - this.origin[a])), { index, attributes } = target.geometry;
    const normal = new T.Vector3();
    for (let i = 0; i < index.count; i += 3) {
      const corners = [0, 1, 2].map((c) => index.getX(i + c));
      if (!corners.includes(node)) continue;
      const [a, b, c] = corners.map((corner) => new T.Vector3().fromBufferAttribute(attributes.position, corner));
      normal.add(b.sub(a).cross(c.sub(a)).normalize());
    }
    normal.transformDirection(target.mesh.matrixWorld);
    const way = this.camera.position.clone().sub(this.controls.target).normalize();
    if (normal.dot(way) < 0.2) way.addScaledVector(normal, 1 - normal.dot(way)).normalize();
    this.touched = true;
    this.look(Math.atan2(way.y, way.x) * 180 / Math.PI, Math.asin(clamp(way.z, -1, 1)) * 180 / Math.PI, this.seen, middle.toArray());
  }

  // Where vertex `node` of a part is [m], or null.
  vertex(part, node) {
    const target = this.targets().find((one) => one.part === part);
    if (!target || node >= target.geometry.attributes.position.count) return null;
    const place = new THREE.Vector3().fromBufferAttribute(target.geometry.attributes.position, node);
    return place.applyMatrix4(target.mesh.matrixWorld).toArray().map((v, a) => v + this.origin[a]);
  }

  // What can be picked: meshes, each with the `name` of its body and the number `first` of its first vertex.
  // Bodies are parts by their number, a ball that is a piece by the number of the piece behind those.
  targets() {
    const bodies = this.bodies.map(({ mesh, geometry }, part) => ({ part, mesh, geometry, first: 0, name: this.stage.bodies[part].name }));
    const pieces = this.pieces.map(({ mesh, geometry }, p) => ({ part: bodies.length + p, mesh, geometry, name: this.stage.pieces[p].name }));
    return [...bodies, ...pieces.filter(({ mesh, name }) => mesh.visible && name === "ball")];
  }

  // What is under the pointer of a mouse event, or null: the `point` of the surface [m], the name of the `body`, and of
  // the vertex nearest to it its number in all bodies, `vertex`, or null, and in its `part`, `node`. `targets`: among
  // which it is.
  pick({ clientX, clientY }, targets = this.targets()) {
    const T = THREE, box = this.canvas.getBoundingClientRect(), caster = new T.Raycaster();
    const at = new T.Vector2(2 * (clientX - box.left) / box.width - 1, 1 - 2 * (clientY - box.top) / box.height);
    this.camera.updateMatrixWorld();
    caster.setFromCamera(at, this.camera);
    let best = null;
    for (const target of targets) {
      target.geometry.boundingSphere = new T.Sphere(new T.Vector3(), Infinity);
      const [hit] = caster.intersectObject(target.mesh, false);
      if (hit && (!best || hit.distance < best.distance)) best = { ...hit, ...target };
    }
    if (!best) return null;
    const { face, point, part, mesh, geometry, first, name } = best, place = new T.Vector3();
    const far = (n) => place.fromBufferAttribute(geometry.attributes.position, n).applyMatrix4(mesh.matrixWorld).distanceTo(point);
    const node = [face.a, face.b, face.c].sort((n, m) => far(n) - far(m))[0];
    return { vertex: first === undefined ? null : first + node, point: point.toArray().map((v, a) => v + this.origin[a]), body: name, part, node };
  }

  // Texts over the picture, each [element, x, y] in pixels of the page.
  captions() { return []; }

  // The picture as it is, as a PNG on `background`, a colour, with what explains it: captions; from below `words`, the
  // `key` of the colours, see `Colours`, and lines about `arrows`, each {text, colour}. Texts that are too wide continue
  // on the next line; of arrows as many are told as fit into the lower part of the picture.
  async screenshot(background = "#ffffff", words = [], key = null, arrows = []) {
    this.render();
    const { width, height } = this.canvas, sheet = document.createElement("canvas"), { ratio } = this;
    const size = (width < NARROW * ratio ? 11 : 15) * ratio, high = 1.4 * size, inset = 0.5 * size;
    Object.assign(sheet, { width, height });
    const pen = sheet.getContext("2d");
    let y = height - 0.8 * size;
    const line = (text, colour = "#333", x = size) => { pen.fillStyle = colour; pen.fillText(text, x, y); return x + pen.measureText(text).width; };
    pen.fillStyle = background;
    pen.fillRect(0, 0, width, height);
    pen.drawImage(this.canvas, 0, 0);
    pen.font = `${size}px system-ui, sans-serif`;
    const rows = (text, colour) => wrapped(pen, text, width - 3 * size).map((part) => ({ text: part, colour }));
    const below = [...(key ? [...rows(key.title), key] : []), ...words.flatMap((text) => rows(text))];
    const told = arrows.map(({ text, colour }) => rows(`➜ ${text}`, colour)), room = Math.floor(LEGEND_SHARE * height / high) - below.length;
    let fit = told.length;
    while (fit > 0 && told.slice(0, fit).flat().length + (fit < told.length) > room) fit--;
    const more = fit < told.length ? rows(`and ${told.length - fit} more`) : [], all = [...told.slice(0, fit).flat(), ...more, ...below];
    const colourBar = ({ low, high: end, map }) => {
      const start = line(low) + 0.5 * size, one = 14 * size / 256;
      for (let i = 0; i < 256; i++) {
        pen.fillStyle = `rgb(${map.slice(3 * i, 3 * i + 3).join()})`;
        pen.fillRect(start + i * one, y - 0.8 * size, one + 1, size);
      }
      return line(end, "#333", start + 14.5 * size);
    };
    const widest = Math.max(0, ...all.map((row) => (row === key ? pen.measureText(key.low + key.high).width + 15 * size : pen.measureText(row.text).width)));
    pen.fillStyle = `${background}cc`;
    pen.fillRect(inset, height - inset - all.length * high, widest + 2 * inset, all.length * high);
    for (const row of all.reverse()) {
      if (row === key) colourBar(key); else line(row.text, row.colour);
      y -= high;
    }
    pen.font = `${12 * ratio}px system-ui, sans-serif`;
    pen.textAlign = "center";
    for (const [element, x, at] of this.captions()) {
      y = ratio * (at - 6);
      line(element.textContent, "#334", ratio * x);
    }
    return new Promise((done) => sheet.toBlob(done, "image/png"));
  }
}
