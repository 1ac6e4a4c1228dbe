// The mesh of a body, and the triangles that show it. Places are relative to the contact.

// Return the arrays of a mesh, whose cells and faces are stored as differences.
async function unpackMesh(layout) {
  const found = await unpack(layout);
  const { cells, faces } = found;
  const m = cells.length / 4;
  for (let i = 1; i < m; i++) cells[i] += cells[i - 1];
  for (let i = m; i < 4 * m; i++) cells[i] += cells[i - m];
  for (let i = 1; i < faces.length; i++) faces[i] += faces[i - 1];
  return found;
}

// A quadrangle's halves, by the ends of the cell's edges that are cut; the edge in its middle is none of the polygon's.
const HALVES = [[[0, 2], [0, 3], [1, 3]], [[1, 3], [1, 2], [0, 2]]];
const HALF = [[1, 1, 0], [0, 1, 0], [0, 1, 1]];

class Mesh {
  // Displacements are in units of `unit`, the largest is `largest`.
  constructor({ points, cells, faces, groups, shift, ...values }, unit, largest) {
    Object.assign(this, { points, cells, faces, groups, shift, values, unit, largest });
    this.n = points.length / 3;
    this.m = cells.length / 4;
  }
  // The points' places along a direction.
  heights([x, y, z]) {
    const { points, n } = this;
    const found = new Float32Array(n);
    for (let a = 0; a < n; a++) found[a] = x * points[a] + y * points[n + a] + z * points[2 * n + a];
    return found;
  }
  // The value of a cell: the number of its region, or a share of the scale, none where faces have values; undefined
  // where points have.
  valueOf(cell, { array, labels, faces }) {
    if (!array) return undefined;
    if (faces) return 0;
    return labels ? this.values[array][cell] : this.values[array][cell] / 255;
  }
  // Put a vertex on the edge from point a to point b, at the share t. Millions of them: no arrays are made here.
  put(made, a, b, t, value, group, edge) {
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
    data[first + 7] = group;
  }
  surface(colour) {
    const { faces, groups, cells, m } = this;
    const made = new Vertices();
    for (let i = 0; i < faces.length; i++) {
      const cell = faces[i] >> 2;
      const value = colour.faces ? this.values[colour.array][i] / 255 : this.valueOf(cell, colour);
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
    const { cells, m } = this;
    const made = new Vertices();
    const height = this.heights(normal).map((value) => value - offset);
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
        this.put(made, a, b, height[a] / (height[a] - height[b]), value, 0, edge);
      };
      if (before === 1) for (let j = 0; j < 3; j++) put(0, j + 1, CORNERS[j]);
      else if (before === 3) for (let j = 0; j < 3; j++) put(j, 3, CORNERS[j]);
      else for (const half of HALVES) for (let j = 0; j < 3; j++) put(half[j][0], half[j][1], HALF[j]);
    }
    return made;
  }
}
