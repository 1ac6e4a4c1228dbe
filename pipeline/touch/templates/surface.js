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
    for (let v = 0; v < count; v++) this.move(v, near);
    for (let v = 0; v < 3 * count; v++) if (!Number.isFinite(moved[v] + regular[v])) moved[v] = 0;
    return triangles;
  }
  move(v, { tool, x, y, a, force, square, plane, poisson, depth, radius, angle }) {
    const { rest, moved, regular, model } = this;
    const [fx, fy, fz] = [rest[3 * v] - x, rest[3 * v + 1] - y, rest[3 * v + 2]];
    const soft = 1 - 2 * poisson;
    let [aside, down] = [0, 0];
    if (Math.abs(fz) <= SEEN.FACE * model.thickness) {
      const rho = Math.max(Math.hypot(fx, fy), SEEN.AXIS * a);
      const [sunk, share] = onFace(tool, rho, a, plane);
      aside = ((-soft * (1 + poisson)) / (2 * Math.PI)) * (share / rho ** 2);
      moved[3 * v + 2] = force * (regular[3 * v + 2] - sunk);
      if (rho <= a) moved[3 * v + 2] = rise(tool, rho, radius, angle) - depth;
    } else {
      const under = Math.max(-fz, 0);
      const flat = fx * fx + fy * fy;
      const one = 1 / Math.sqrt(Math.max(flat + under ** 2, square));
      const third = one ** 3;
      const fifth = third * one ** 2;
      const bend = 15 * flat * one ** 2;
      const unit = (1 + poisson) / (2 * Math.PI);
      aside = under * third - (soft * one) / (1 / one + under);
      aside = unit * (aside + (square / 4) * fifth * under * (bend - 12 + 3 * soft));
      down = under ** 2 * third + (1 + soft) * one;
      down += (square / 4) * (under ** 2 * fifth * (bend - 6) + (1 + soft) * third * (1 - 3 * under ** 2 * one ** 2));
      moved[3 * v + 2] = force * (regular[3 * v + 2] - unit * down);
    }
    moved[3 * v] = force * (aside * fx + regular[3 * v]);
    moved[3 * v + 1] = force * (aside * fy + regular[3 * v + 1]);
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
    for (let t = 0; t < m; t++) now.push(this.triangles[t], this.triangles[m + t], this.triangles[2 * m + t]);
    const done = [];
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

function onFace(tool, rho, a, plane) {
  const [far, near] = [Math.max(rho, a), Math.min(rho / a, 1)];
  const [angle, beside, left] = [Math.asin(a / far), Math.sqrt(far ** 2 - a ** 2), Math.sqrt(1 - near ** 2)];
  if (tool === "disc") return [angle / (Math.PI * plane * a), 1 - left];
  if (tool === "sphere") {
    return [(0.75 / (Math.PI * plane * a ** 3)) * ((2 * a ** 2 - far ** 2) * angle + a * beside), 1 - left ** 3];
  }
  const sunk = (2 / (Math.PI * plane * a ** 2)) * (a * angle - a ** 2 / (far + beside));
  return [sunk, 1 - left + near ** 2 * Math.acosh(1 / near)];
}

function rise(tool, rho, radius, angle) {
  if (tool === "disc") return 0;
  return tool === "sphere" ? radius - Math.sqrt(radius ** 2 - rho ** 2) : rho / Math.tan(angle);
}
