"use strict";
// A film: a stage (what there is) and reels (pictures one after the other), see packing.py. Metres, seconds, z up.

const KINDS = { u1: Uint8Array, u2: Uint16Array, u4: Uint32Array, f4: Float32Array, f8: Float64Array };
const MISSING = 255; // code of a value of a field that is missing

async function unpack(text) {
  const raw = atob(text), bytes = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
  const stream = new Response(bytes).body.pipeThrough(new DecompressionStream("deflate"));
  const buffer = await new Response(stream).arrayBuffer();
  return ([kind, first, count]) => new KINDS[kind](buffer, first, count);
}

// Whole numbers of n places in each picture, from what `_smooth` of packing.py made of them.
function rough(bytes, n) {
  const count = bytes.length / 2, out = new Uint16Array(count);
  for (let i = 0; i < count; i++) {
    const folded = bytes[i] | bytes[count + i] << 8;
    out[i] = folded >> 1 ^ -(folded & 1);
  }
  for (let i = 2 * n; i < count; i++) out[i] += out[i - n]; // wraps
  for (let i = n; i < count; i++) out[i] += out[i - n];
  return out;
}

// Arrows of each picture, points and vectors, from what `_packed_arrows` of packing.py made of them.
function arrowsOf(counts, low, step, part, bytes) {
  const total = bytes.length / 12, found = []; // low bytes of three coordinates and three components, then high ones
  const whole = new Int16Array(6 * total);
  let first = 0, before = 0, had = 0;
  for (const count of counts) {
    for (let j = 0; j < count; j++) for (let c = 0; c < 6; c++) {
      const at = c * total + first + j, folded = bytes[at] | bytes[6 * total + at] << 8;
      whole[at] = (folded >> 1 ^ -(folded & 1)) + (j < had ? whole[c * total + before + j] : 0);
    }
    const points = new Float32Array(3 * count), vectors = new Float32Array(3 * count);
    for (let i = 0; i < 3 * count; i++) {
      const a = i % 3, at = a * total + first + (i - a) / 3;
      points[i] = low[a] + step[a] * whole[at];
      vectors[i] = part * whole[3 * total + at];
    }
    found.push({ points, vectors });
    [before, had, first] = [first, count, first + count];
  }
  return found;
}

class Film {
  constructor(stage) {
    this.stage = stage;
    this.times = [];
    this.bodies = stage.bodies.map(() => []); // for each picture {low, step, whole}
    this.fields = stage.bodies.map((body) => body.fields.map(() => [])); // for each picture {low, step, codes}
    this.ends = stage.bodies.map((body) => body.fields.map(() => [Infinity, -Infinity])); // lowest and highest value
    this.moved = []; // of each body: up to which picture, how far
    this.arrows = stage.arrows.map(() => []); // for each picture {points, vectors}
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
      const low = read(reel.bodies[b].low), step = read(reel.bodies[b].step), n = 3 * body.nodes;
      const whole = rough(read(reel.bodies[b].positions), n);
      for (let i = 0; i < k; i++) this.bodies[b].push({
        low: low.subarray(3 * i, 3 * i + 3), step: step.subarray(3 * i, 3 * i + 3), whole: whole.subarray(n * i, n * i + n) });
      reel.bodies[b].fields.forEach((field, f) => {
        const codes = read(field.codes), m = body.nodes;
        for (let i = m; i < codes.length; i++) codes[i] += codes[i - m]; // wraps
        const [low, high] = this.ends[b][f];
        if (codes.some((code) => code !== MISSING))
          this.ends[b][f] = [Math.min(low, field.low), Math.max(high, field.low + (MISSING - 1) * field.step)];
        for (let i = 0; i < k; i++) this.fields[b][f].push({ low: field.low, step: field.step, codes: codes.subarray(m * i, m * i + m) });
      });
    });
    reel.arrows.forEach((arrow, a) => {
      this.stage.arrows[a].longest = Math.max(this.stage.arrows[a].longest, arrow.longest);
      this.arrows[a].push(...arrowsOf(read(arrow.counts), read(arrow.low), read(arrow.step), arrow.part, read(arrow.rows)));
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

  // Values of field f of body b in the picture at hand, NaN where one is missing.
  values(b, f, [i], out) {
    const { low, step, codes } = this.fields[b][f][i];
    for (let j = 0; j < out.length; j++) out[j] = codes[j] === MISSING ? NaN : low + step * codes[j];
  }

  // Lowest and highest value in all pictures of field f of body b; without f of the displacement.
  limits(b, f) {
    if (f >= 0) return this.ends[b][f];
    const out = new Float32Array(this.stage.bodies[b].nodes), [from, so] = this.moved[b] ?? [0, 0];
    let high = so;
    for (let i = from; i < this.length; i++) { this.displacement(b, [i, 0], out); for (const v of out) if (v > high) high = v; }
    this.moved[b] = [this.length, high];
    return [0, high];
  }

  // How far nodes of body b are from where they were in the first picture.
  displacement(b, [i, w], out) {
    const first = this.bodies[b][0], one = this.bodies[b][i], two = w > 0 ? this.bodies[b][i + 1] : one;
    out.fill(0);
    for (let a = 0; a < 3; a++) {
      const p = (1 - w) * one.step[a], q = w * two.step[a], o = (1 - w) * one.low[a] + w * two.low[a] - first.low[a], s = first.step[a];
      for (let j = 0, k = a; j < out.length; j++, k += 3) {
        const moved = o + p * one.whole[k] + q * two.whole[k] - s * first.whole[k];
        out[j] += moved * moved;
      }
    }
    for (let j = 0; j < out.length; j++) out[j] = Math.sqrt(out[j]);
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

  // Positions of piece p until the picture at hand, 3 numbers each; without those in which it is not there.
  path(p, [i]) {
    return this.poses[p].slice(0, i + 1).filter((pose) => pose.every(Number.isFinite)).flatMap((pose) => [pose[0], pose[1], pose[2]]);
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


// The text that was packed by deflate.
async function unpackText(text) {
  const raw = atob(text), bytes = Uint8Array.from(raw, (c) => c.charCodeAt(0));
  return new Response(new Response(bytes).body.pipeThrough(new DecompressionStream("deflate"))).text();
}
