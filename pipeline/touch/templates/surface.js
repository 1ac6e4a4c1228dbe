// What is seen of a touch: pipeline/realtime/surface.py, with triangles made smaller near the tool.

const MOMENTS = { disc: 2 / 3, sphere: 2 / 5, cone: 1 / 3 };
// What is nearer to the face, in units of the thickness, lies on it; to the axis, in units of a, is it. Edges near the
// tool are halved until they are shorter than this share of the contact's radius and of the way to its axis.
const SEEN = { FACE: 1e-6, AXIS: 1e-6, FINE: 0.18, LEVELS: 6, MOST: 30000 };

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
    this.spans = Float64Array.from({ length: this.m }, (_, t) => this.spanOf(t));
  }
  // The longest edge of a triangle.
  spanOf(t) {
    const corners = [0, 1, 2].map((j) => 3 * this.triangles[j * this.m + t]);
    const edge = (p, q) => Math.hypot(...[0, 1, 2].map((i) => this.rest[p + i] - this.rest[q + i]));
    return Math.max(...corners.map((p, j) => edge(p, corners[(j + 1) % 3])));
  }
  amountsAt(x, y, poisson, square) {
    const [rank, counts, rows, columns] = this.shape;
    const [a, b] = this.model.reach;
    const [along, across] = [polynomials(x / a, columns), polynomials(y / b, rows)];
    const [over] = polynomials(middleOf(this.model.poisson_range, poisson), counts);
    const weights = [];
    for (let p = 0; p < counts; p++) {
      for (let j = 0; j < rows; j++) {
        for (let i = 0; i < columns; i++) {
          const bent = (across[0][j] * along[2][i]) / a ** 2 + (across[2][j] * along[0][i]) / b ** 2;
          weights.push(over[p] * (across[0][j] * along[0][i] + (square / 4) * bent));
        }
      }
    }
    const found = new Float64Array(rank);
    for (let k = 0; k < rank; k++) {
      for (let w = 0; w < weights.length; w++) found[k] += this.amounts[k * weights.length + w] * weights[w];
    }
    return found;
  }
  far(x, y, poisson, square) {
    const { modes, regular, n } = this;
    const amounts = this.amountsAt(x, y, poisson, square);
    const rank = amounts.length;
    for (let row = 0, at = 0; row < 3 * n; row++) {
      let sum = 0;
      for (let k = 0; k < rank; k++) sum += modes[at++] * amounts[k];
      regular[row] = sum;
    }
  }
  // Put into `moved` the displacement of all vertices, local; return the triangles (flat) that show it.
  press(query, touch, refine) {
    const { model, moved, regular, n } = this;
    const { poisson = model.poisson, young = model.young } = query;
    const [x, y] = model.local(query.at);
    const force = inner(model.axes[2], touch.force) / young;
    const a = touch.radius;
    const square = MOMENTS[query.tool] * a ** 2;
    this.far(x, y, poisson, square);
    const near = { ...query, poisson, x, y, a, force, square, plane: 1 / (1 - poisson ** 2) };
    const { triangles, count } = refine ? this.refined(x, y, a) : { triangles: null, count: n };
    this.move(count, near);
    return triangles;
  }
  // Move the first `count` vertices; no arrays are made within.
  move(count, { tool, x, y, a, force, square, plane, poisson, depth, radius, angle }) {
    const { rest, moved, regular, model } = this;
    const soft = 1 - 2 * poisson;
    const unit = (1 + poisson) / (2 * Math.PI);
    const onFace = SUNK[tool](a, plane);
    const least = SEEN.AXIS * a;
    const flatness = SEEN.FACE * model.thickness;
    for (let v = 0; v < 3 * count; v += 3) {
      const fx = rest[v] - x;
      const fy = rest[v + 1] - y;
      const fz = rest[v + 2];
      const flat = fx * fx + fy * fy;
      let aside = 0;
      if (Math.abs(fz) <= flatness) {
        const rho = Math.max(Math.sqrt(flat), least);
        const near = Math.min(rho / a, 1);
        aside = (-soft * unit * WITHIN[tool](near, Math.sqrt(1 - near * near))) / (rho * rho);
        if (rho <= a) moved[v + 2] = rise(tool, rho, radius, angle) - depth;
        else moved[v + 2] = force * (regular[v + 2] - onFace(rho));
      } else {
        const under = Math.max(-fz, 0);
        const one = 1 / Math.sqrt(Math.max(flat + under * under, square));
        const third = one * one * one;
        const fifth = third * one * one;
        const bend = 15 * flat * one * one;
        const quarter = square / 4;
        aside = under * third - (soft * one) / (1 / one + under);
        aside = unit * (aside + quarter * fifth * under * (bend - 12 + 3 * soft));
        let down = under * under * third + (1 + soft) * one;
        const turned = 1 - 3 * under * under * one * one;
        down += quarter * (under * under * fifth * (bend - 6) + (1 + soft) * third * turned);
        moved[v + 2] = force * (regular[v + 2] - unit * down);
      }
      moved[v] = force * (aside * fx + regular[v]);
      moved[v + 1] = force * (aside * fy + regular[v + 1]);
    }
  }
  // Halve edges by their own length and place alone, so that neighbours agree.
  refined(x, y, a) {
    const { rest, regular, n, m } = this;
    let count = n;
    const between = new Map();
    const middle = (p, q) => {
      const key = Math.min(p, q) * SEEN.MOST + Math.max(p, q);
      if (between.has(key)) return between.get(key);
      const [mx, my, mz] = [0, 1, 2].map((i) => (rest[3 * p + i] + rest[3 * q + i]) / 2);
      const length = Math.hypot(...[0, 1, 2].map((i) => rest[3 * p + i] - rest[3 * q + i]));
      const away = Math.abs(Math.hypot(mx - x, my - y, mz) - a);
      let found = -1;
      if (length > SEEN.FINE * Math.max(a, away) + 0.5 * away && count < SEEN.MOST) {
        found = count++;
        rest.set([mx, my, mz], 3 * found);
        for (let i = 0; i < 3; i++) regular[3 * found + i] = (regular[3 * p + i] + regular[3 * q + i]) / 2;
      }
      between.set(key, found);
      return found;
    };
    let now = [];
    const done = [];
    for (let t = 0; t < m; t++) {
      const [p, q, r] = [this.triangles[t], this.triangles[m + t], this.triangles[2 * m + t]];
      // No edge of a triangle so far away is halved.
      const away = Math.hypot(rest[3 * p] - x, rest[3 * p + 1] - y, rest[3 * p + 2]) - a - this.spans[t];
      (this.spans[t] > 0.5 * away ? now : done).push(p, q, r);
    }
    for (let level = 0; level < SEEN.LEVELS && now.length; level++) {
      const next = [];
      for (let t = 0; t < now.length; t += 3) {
        const c = [now[t], now[t + 1], now[t + 2]];
        const e = [middle(c[1], c[2]), middle(c[2], c[0]), middle(c[0], c[1])];
        const split = e.filter((at) => at >= 0).length;
        if (split === 0) done.push(...c);
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
    return { triangles: done.concat(now), count };
  }
}

// w/F on the face of a half-space, beyond the contact.
const SUNK = {
  disc: (a, plane) => (rho) => Math.asin(a / rho) / (Math.PI * plane * a),
  sphere: (a, plane) => (rho) => {
    const beside = Math.sqrt(rho * rho - a * a);
    return (0.75 / (Math.PI * plane * a ** 3)) * ((2 * a * a - rho * rho) * Math.asin(a / rho) + a * beside);
  },
  cone: (a, plane) => (rho) => {
    const beside = Math.sqrt(rho * rho - a * a);
    return (2 / (Math.PI * plane * a * a)) * (a * Math.asin(a / rho) - (a * a) / (rho + beside));
  },
};

// P(ρ)/F at ρ = near·a, left = (1 - near²)^½.
const WITHIN = {
  disc: (near, left) => 1 - left,
  sphere: (near, left) => 1 - left ** 3,
  cone: (near, left) => 1 - left + near * near * Math.acosh(1 / near),
};

function rise(tool, rho, radius, angle) {
  if (tool === "disc") return 0;
  return tool === "sphere" ? radius - Math.sqrt(radius ** 2 - rho ** 2) : rho / Math.tan(angle);
}
