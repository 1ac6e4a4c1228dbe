// What is seen of a touch: realtime/src/surface.c, with triangles made smaller near the tool.

// What is nearer to the face, in units of the thickness, lies on it. Edges near the tool are halved until they are
// shorter than this share of the contact's radius and of the way to its axis.
const SEEN = { FACE: 1e-6, FINE: 0.18, LEVELS: 6, MOST: 30000 };

class Surface {
  // Arrays of the file: points (3, n) in m, triangles (3, m), modes (n, 3, rank), amounts (rank, ν, y, x).
  constructor(model, { points, triangles, modes, amounts }, shape) {
    Object.assign(this, { model, points, triangles, shape, amounts, modes: Float32Array.from(modes) });
    this.n = points.length / 3;
    this.m = triangles.length / 3;
    this.rest = new Float64Array(3 * SEEN.MOST); // places, then R, of vertices and of those that are put between
    this.regular = new Float64Array(3 * SEEN.MOST);
    this.moved = new Float64Array(3 * SEEN.MOST);
    for (let a = 0; a < this.n; a++) for (let i = 0; i < 3; i++) this.rest[3 * a + i] = points[i * this.n + a];
    this.shown = new Int32Array(3 * (this.m + 2 * SEEN.MOST)); // each new vertex makes two triangles more at most
    this.spans = Float64Array.from({ length: this.m }, (_, t) => this.spanOf(t));
  }
  // The longest edge of a triangle.
  spanOf(t) {
    const corners = [0, 1, 2].map((j) => 3 * this.triangles[j * this.m + t]);
    const edge = (p, q) => Math.hypot(...[0, 1, 2].map((i) => this.rest[p + i] - this.rest[q + i]));
    return Math.max(...corners.map((p, j) => edge(p, corners[(j + 1) % 3])));
  }
  amountsAt(x, y, poisson, spread) {
    const [rank, counts, rows, columns] = this.shape;
    const [a, b] = this.model.reach;
    const [along, across] = [polynomials(x / a, columns), polynomials(y / b, rows)];
    const [over] = polynomials(middleOf(this.model.poisson_range, poisson), counts);
    const [[xx, xy], [, yy]] = spread;
    const weights = [];
    for (let p = 0; p < counts; p++) {
      for (let j = 0; j < rows; j++) {
        for (let i = 0; i < columns; i++) {
          const bent = (xx / (2 * a ** 2)) * across[0][j] * along[2][i] + (yy / (2 * b ** 2)) * across[2][j] * along[0][i];
          const twist = (xy / (a * b)) * across[1][j] * along[1][i];
          weights.push(over[p] * (across[0][j] * along[0][i] + bent + twist));
        }
      }
    }
    const found = new Float64Array(rank);
    for (let k = 0; k < rank; k++) {
      for (let w = 0; w < weights.length; w++) found[k] += this.amounts[k * weights.length + w] * weights[w];
    }
    return found;
  }
  far(px, py, poisson, spread) {
    const { modes, regular, n } = this;
    const amounts = this.amountsAt(px, py, poisson, spread);
    const rank = amounts.length;
    // Three sums at a time: one alone would wait for itself at each step.
    for (let row = 0, at = 0; row < 3 * n; row += 3, at += 3 * rank) {
      let x = 0;
      let y = 0;
      let z = 0;
      for (let k = 0; k < rank; k++) {
        const amount = amounts[k];
        x += modes[at + k] * amount;
        y += modes[at + rank + k] * amount;
        z += modes[at + 2 * rank + k] * amount;
      }
      regular[row] = x;
      regular[row + 1] = y;
      regular[row + 2] = z;
    }
  }
  // Put into `moved` the displacement of all vertices, local; return the triangles (flat) that show it.
  press(query, touch, refine) {
    const { model, n } = this;
    const { poisson = model.poisson, young = model.young, depth } = query;
    const place = model.local(query.at);
    const foot = new Footprint(touch.shape, touch.radius);
    const { turn } = touch.spot;
    const force = inner(turn[2], model.axes.map((axis) => inner(axis, touch.force))) / young;
    foot.prepare(poisson, SEEN.FACE * model.thickness);
    this.far(place[0], place[1], poisson, foot.spread);
    const { triangles, count } = refine ? this.refined(place, turn, foot) : { triangles: null, count: n };
    this.move(count, place, turn, foot, force, depth);
    return triangles;
  }
  // Move the first `count` vertices; no arrays are made within.
  move(count, [px, py, pz], [[ax, ay, az], [bx, by, bz], [nx, ny, nz]], foot, force, depth) {
    const { rest, moved, regular } = this;
    const { at } = foot;
    for (let v = 0; v < 3 * count; v += 3) {
      const [dx, dy, dz] = [rest[v] - px, rest[v + 1] - py, rest[v + 2] - pz];
      const x = ax * dx + ay * dy + az * dz;
      const y = bx * dx + by * dy + bz * dz;
      const z = nx * dx + ny * dy + nz * dz;
      foot.field(x, y, z);
      moved[v] = force * (ax * at[0] + bx * at[1] + nx * at[2] + regular[v]);
      moved[v + 1] = force * (ay * at[0] + by * at[1] + ny * at[2] + regular[v + 1]);
      moved[v + 2] = force * (az * at[0] + bz * at[1] + nz * at[2] + regular[v + 2]);
      if (!foot.holds(x, y, z)) continue;
      // What the tool covers goes with it.
      const more = foot.lifted(x, y, z) - depth - (nx * moved[v] + ny * moved[v + 1] + nz * moved[v + 2]);
      moved[v] += more * nx;
      moved[v + 1] += more * ny;
      moved[v + 2] += more * nz;
    }
  }
  // Halve edges by their own length and place alone, so that neighbours agree.
  refined([x, y, z], turn, foot) {
    const { rest, regular, n, m } = this;
    let count = n;
    const between = new Map();
    const middle = (p, q) => {
      const key = Math.min(p, q) * SEEN.MOST + Math.max(p, q);
      if (between.has(key)) return between.get(key);
      const [mx, my, mz] = [0, 1, 2].map((i) => (rest[3 * p + i] + rest[3 * q + i]) / 2);
      const length = Math.hypot(...[0, 1, 2].map((i) => rest[3 * p + i] - rest[3 * q + i]));
      const away = foot.away(...turn.map((unit) => inner(unit, [mx - x, my - y, mz - z])));
      let found = -1;
      if (length > SEEN.FINE * Math.max(foot.a, away) + 0.5 * away && count < SEEN.MOST) {
        found = count++;
        rest.set([mx, my, mz], 3 * found);
        for (let i = 0; i < 3; i++) regular[3 * found + i] = (regular[3 * p + i] + regular[3 * q + i]) / 2;
      }
      between.set(key, found);
      return found;
    };
    let now = [];
    const { triangles, spans, shown: done } = this;
    let size = 0;
    for (let t = 0; t < m; t++) {
      const p = triangles[t];
      const [dx, dy, dz] = [rest[3 * p] - x, rest[3 * p + 1] - y, rest[3 * p + 2] - z];
      // No edge of a triangle so far away is halved.
      const near = 3 * spans[t] + foot.reach;
      if (dx * dx + dy * dy + dz * dz < near * near) now.push(p, triangles[m + t], triangles[2 * m + t]);
      else for (let j = 0; j < 3; j++) done[size++] = triangles[j * m + t];
    }
    const keep = (corners) => {
      for (const at of corners) done[size++] = at;
    };
    for (let level = 0; level < SEEN.LEVELS && now.length; level++) {
      const next = [];
      for (let t = 0; t < now.length; t += 3) {
        const c = [now[t], now[t + 1], now[t + 2]];
        const e = [middle(c[1], c[2]), middle(c[2], c[0]), middle(c[0], c[1])];
        const split = e.filter((at) => at >= 0).length;
        if (split === 0) keep(c);
        else if (split === 3) next.push(c[0], e[2], e[1], e[2], c[1], e[0], e[1], e[0], c[2], e[0], e[1], e[2]);
        else {
          // Turn it so that what is halved, or what is not, lies opposite to the first corner.
          const i = e.findIndex((at) => (split === 1 ? at >= 0 : at < 0));
          const [p, q, r] = [c[i], c[(i + 1) % 3], c[(i + 2) % 3]];
          const [ep, eq, er] = [e[i], e[(i + 1) % 3], e[(i + 2) % 3]];
          if (split === 1) next.push(p, q, ep, p, ep, r);
          else next.push(p, er, eq, er, q, r, er, r, eq);
        }
      }
      now = next;
    }
    keep(now);
    return { triangles: done.subarray(0, size), count };
  }
}
