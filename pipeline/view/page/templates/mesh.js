"use strict";
// The mesh of a body, and the triangles that show it. Lengths are in mm, places relative to the contact.

const KINDS = { f4: Float32Array, i4: Int32Array, i2: Int16Array, u1: Uint8Array };

// Return the arrays of a page by name: first bytes of all numbers, then second ones.
async function unpack(text, layout) {
  const coded = atob(text);
  const bytes = new Uint8Array(coded.length);
  for (let i = 0; i < coded.length; i++) bytes[i] = coded.charCodeAt(i);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  const raw = new Uint8Array(await new Response(stream).arrayBuffer());
  const found = {};
  let start = 0;
  for (const [name, kind, count] of layout) {
    const made = new KINDS[kind](count);
    const into = new Uint8Array(made.buffer);
    const width = made.BYTES_PER_ELEMENT;
    for (let b = 0; b < width; b++) for (let i = 0; i < count; i++) into[i * width + b] = raw[start + b * count + i];
    start += width * count;
    found[name] = made;
  }
  return found;
}

// Return the arrays of a mesh, whose cells and faces are stored as differences.
async function unpackMesh(text, layout) {
  const found = await unpack(text, layout);
  const { cells, faces } = found;
  const m = cells.length / 4;
  for (let i = 1; i < m; i++) cells[i] += cells[i - 1];
  for (let i = m; i < 4 * m; i++) cells[i] += cells[i - m];
  for (let i = 1; i < faces.length; i++) faces[i] += faces[i - 1];
  return found;
}

// Floats of a vertex: place, displacement, value, kind, distances to the three edges.
const WIDTH = 11;
// Kinds: groups of the boundary, and what is no part of the body.
const FREE = 0;
const PROBE = 1;
const TOOL = 4;
const LINE = 5;
const CORNERS = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
// A quadrangle's halves, by the ends of the cell's edges that are cut; the edge in its middle is none of the polygon's.
const HALVES = [[[0, 2], [0, 3], [1, 3]], [[1, 3], [1, 2], [0, 2]]];
const HALF = [[1, 1, 0], [0, 1, 0], [0, 1, 1]];

class Vertices {
  constructor() {
    this.data = new Float32Array(WIDTH * 3000);
    this.size = 0;
  }
  // Return where the numbers of a further vertex begin.
  further() {
    if (this.size === this.data.length) {
      const larger = new Float32Array(2 * this.data.length);
      larger.set(this.data);
      this.data = larger;
    }
    this.size += WIDTH;
    return this.size - WIDTH;
  }
  put(place, moved, kind, edge) {
    const first = this.further();
    this.data.set([...place, ...moved, 0, kind, ...edge], first);
  }
}

class Mesh {
  constructor({ points, cells, faces, groups, shift, ...values }, unit) {
    Object.assign(this, { points, cells, faces, groups, shift, values, unit });
    this.n = points.length / 3;
    this.m = cells.length / 4;
    this.largest = 0;
    for (let a = 0; shift && a < this.n; a++) this.largest = Math.max(this.largest, Math.hypot(...this.moved(a)));
  }
  place(a) {
    return [this.points[a], this.points[this.n + a], this.points[2 * this.n + a]];
  }
  moved(a) {
    const { shift, unit, n } = this;
    return shift ? [unit * shift[a], unit * shift[n + a], unit * shift[2 * n + a]] : [0, 0, 0];
  }
  // The value of a cell: the number of its region, or a share of the scale; undefined where points have values.
  valueOf(cell, { array, labels }) {
    if (!array) return undefined;
    return labels ? this.values[array][cell] : this.values[array][cell] / 255;
  }
  // Put a vertex on the edge from point a to point b, at the share t. Millions of them: no arrays are made here.
  put(made, a, b, t, value, kind, edge) {
    const first = made.further();
    const { points, shift, unit, n } = this;
    const { data } = made;
    let square = 0;
    for (let i = 0; i < 3; i++) {
      const p = points[i * n + a];
      data[first + i] = p + t * (points[i * n + b] - p);
      const s = shift ? unit * (shift[i * n + a] + t * (shift[i * n + b] - shift[i * n + a])) : 0;
      data[first + 3 + i] = s;
      square += s * s;
      data[first + 8 + i] = edge[i];
    }
    data[first + 6] = value === undefined ? Math.sqrt(square) / this.largest : value;
    data[first + 7] = kind;
  }
  cornersOf(face) {
    return [0, 1, 2, 3].filter((j) => j !== (face & 3)).map((j) => this.cells[j * this.m + (face >> 2)]);
  }
  surface(colour) {
    const { faces, groups, cells, m } = this;
    const made = new Vertices();
    for (let i = 0; i < faces.length; i++) {
      const cell = faces[i] >> 2;
      const value = this.valueOf(cell, colour);
      for (let j = 0, corner = 0; j < 4; j++) {
        if (j === (faces[i] & 3)) continue;
        const a = cells[j * m + cell];
        this.put(made, a, a, 0, value, groups[i], CORNERS[corner++]);
      }
    }
    return made;
  }
  // The polygons in which a plane cuts cells. A point in the plane counts as before it: a plane of the mesh is cut into
  // the faces of the cells behind it, which stay.
  section(normal, offset, colour) {
    const { points, cells, n, m } = this;
    const made = new Vertices();
    const height = new Float32Array(n);
    for (let a = 0; a < n; a++) {
      height[a] = normal[0] * points[a] + normal[1] * points[n + a] + normal[2] * points[2 * n + a] - offset;
    }
    const ends = new Int32Array(4); // those before the plane from the front, those behind it from the back
    for (let cell = 0; cell < m; cell++) {
      let before = 0;
      for (let j = 0; j < 4; j++) {
        const a = cells[j * m + cell];
        if (height[a] >= 0) ends[before++] = a;
        else ends[3 - j + before] = a;
      }
      if (before % 4 === 0) continue;
      const value = this.valueOf(cell, colour);
      const put = (p, q, edge) => {
        const [a, b] = [ends[p], ends[q]];
        this.put(made, a, b, height[a] / (height[a] - height[b]), value, FREE, edge);
      };
      if (before === 1) for (let j = 0; j < 3; j++) put(0, j + 1, CORNERS[j]);
      else if (before === 3) for (let j = 0; j < 3; j++) put(j, 3, CORNERS[j]);
      else for (const half of HALVES) for (let j = 0; j < 3; j++) put(half[j][0], half[j][1], HALF[j]);
    }
    return made;
  }
  // The tool: its footprint, drawn out of the tissue.
  tool(out) {
    const made = new Vertices();
    const put = (a, up, edge) => made.put(this.place(a).map((p, i) => p + up * out[i]), this.moved(a), TOOL, edge);
    const rim = new Map();
    this.faces.forEach((face, i) => {
      if (this.groups[i] !== PROBE) return;
      const corners = this.cornersOf(face);
      for (const up of [0, 1]) corners.forEach((a, j) => put(a, up, CORNERS[j]));
      for (const [a, b] of [[0, 1], [1, 2], [0, 2]].map((ends) => ends.map((j) => corners[j]))) {
        const key = Math.min(a, b) * this.n + Math.max(a, b);
        if (!rim.delete(key)) rim.set(key, [a, b]);
      }
    });
    for (const [a, b] of rim.values()) {
      for (const corners of [[[a, 0], [b, 0], [b, 1]], [[b, 1], [a, 1], [a, 0]]]) {
        corners.forEach(([p, up], j) => put(p, up, CORNERS[j]));
      }
    }
    return made;
  }
}

function linesOf(polylines) {
  const made = new Vertices();
  for (const line of polylines) {
    for (let i = 1; i < line.length; i++) {
      for (const place of [line[i - 1], line[i]]) made.put(place, [0, 0, 0], LINE, [1, 1, 1]);
    }
  }
  return made;
}
