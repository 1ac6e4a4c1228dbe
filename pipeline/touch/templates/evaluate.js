"use strict";
// The forces of pipeline/realtime/, in the same order and under the same names; SI units, E = 1 within.

const LEAST = { TOUCHING: 1e-12, SMALLEST: 1e-6, STEPS: 60, SAME: 4e-16, TERMS: 40, NEGLIGIBLE: 1e-17 };

// T_n, T_n' and T_n''.
function polynomials(at, count) {
  const [values, slopes, bends] = [[1, at], [0, 1], [0, 0]];
  for (let n = 2; n < count; n++) {
    bends.push(2 * at * bends[n - 1] + 4 * slopes[n - 1] - bends[n - 2]);
    slopes.push(2 * at * slopes[n - 1] + 2 * values[n - 1] - slopes[n - 2]);
    values.push(2 * at * values[n - 1] - values[n - 2]);
  }
  return [values, slopes, bends].map((row) => row.slice(0, count));
}

const inner = (a, b) => a.reduce((sum, value, i) => sum + value * b[i], 0);
const middleOf = ([low, high], poisson) => (high === low ? 0 : (2 * poisson - low - high) / (high - low));

// c, h and g² at a place, with their slopes.
class Table {
  constructor(told) {
    Object.assign(this, told); // reciprocal, curvature (ν, v, u), c_ref, reach, is_round, even, leans, poisson_range
  }
  holds(x, y) {
    const [a, b] = this.reach;
    return this.is_round ? x ** 2 + y ** 2 <= a ** 2 : Math.abs(x) <= a && Math.abs(y) <= b;
  }
  at(x, y, poisson) {
    const [a, b] = this.reach;
    const [evenX, evenY] = this.even;
    const u = this.is_round ? (2 * (x ** 2 + y ** 2)) / a ** 2 - 1 : evenX ? 2 * (x / a) ** 2 - 1 : x / a;
    const v = this.is_round ? 0 : evenY ? 2 * (y / b) ** 2 - 1 : y / b;
    const [counts, rows, columns] = [this.reciprocal.length, this.reciprocal[0].length, this.reciprocal[0][0].length];
    const [across] = polynomials(middleOf(this.poisson_range, poisson), counts);
    const [left, right] = [polynomials(v, rows), polynomials(u, columns)];
    const along = (values) => {
      const flat = left.map((row) =>
        right.map((column) =>
          inner(across, values.map((of) => inner(row, of.map((line) => inner(line, column)))))));
      return this.slopes(flat, x, y);
    };
    const [t, [tx, ty], [txx, txy, tyy]] = along(this.reciprocal);
    const [q, [qx, qy]] = along(this.curvature);
    if (!(t > 0)) return null;
    const slopeC = [-tx / t ** 2, -ty / t ** 2];
    const cxx = (2 * tx ** 2) / t ** 3 - txx / t ** 2;
    const cxy = (2 * tx * ty) / t ** 3 - txy / t ** 2;
    const cyy = (2 * ty ** 2) / t ** 3 - tyy / t ** 2;
    const lean = this.leans ? 1 : 0;
    return {
      c: 1 / t - this.c_ref, h: q / t ** 3, tilt: lean * 0.25 * (slopeC[0] ** 2 + slopeC[1] ** 2), slopeC,
      slopeH: [qx / t ** 3 - (3 * q * tx) / t ** 4, qy / t ** 3 - (3 * q * ty) / t ** 4],
      slopeTilt: [cxx * slopeC[0] + cxy * slopeC[1], cxy * slopeC[0] + cyy * slopeC[1]].map((s) => lean * 0.5 * s),
      plane: 1 / (1 - poisson ** 2),
    };
  }
  slopes([[f, fu, fuu], [fv, fuv], [fvv]], x, y) {
    const [a, b] = this.reach;
    if (this.is_round) {
      const bend = 4 / a ** 2;
      const [ux, uy] = [bend * x, bend * y];
      return [f, [fu * ux, fu * uy], [fuu * ux ** 2 + fu * bend, fuu * ux * uy, fuu * uy ** 2 + fu * bend]];
    }
    const [ux, uxx] = this.even[0] ? [(4 / a ** 2) * x, 4 / a ** 2] : [1 / a, 0];
    const [vy, vyy] = this.even[1] ? [(4 / b ** 2) * y, 4 / b ** 2] : [1 / b, 0];
    return [f, [fu * ux, fv * vy], [fuu * ux ** 2 + fu * uxx, fuv * ux * vy, fvv * vy ** 2 + fv * vyy]];
  }
}

function tangent(a, { c, h, plane }) {
  return 0.5 / (plane * a) + c + (a ** 2 / 3) * h - (2 / 45) * plane * h ** 2 * a ** 5;
}

// Each presses to a depth: force, aside, stiffness, radius and the mean of ρ², or nothing if the contact is too large.
class Disc {
  constructor(radius) {
    this.radius = radius;
  }
  press(depth, place, most) {
    const { radius: a } = this;
    const { h, plane } = place;
    if (a > most) return null;
    const force = depth / (tangent(a, place) - (4 / 3) * plane * a ** 3 * place.tilt);
    const aside = [0, 1].map((i) => {
      const slope = place.slopeC[i] + place.slopeH[i] * (a ** 2 / 3 - (4 / 45) * plane * h * a ** 5);
      return 0.5 * force ** 2 * (slope - (4 / 3) * plane * a ** 3 * place.slopeTilt[i]);
    });
    const square = (2 / 3) * a ** 2 - (8 / 45) * plane * h * a ** 5;
    return { force, aside, stiffness: force / depth, radius: a, square };
  }
}

const NONE = { depth: -1, slope: 0 };

class Round {
  press(depth, place, most) {
    let [low, high] = [0, Math.min(most, this.limit)];
    if (!(this.at(high, place).depth >= depth)) return null;
    let a = Math.min(this.first(depth), 0.5 * high);
    for (let i = 0; i < LEAST.STEPS; i++) {
      const found = this.at(a, place);
      if (found.depth < depth) low = a;
      else high = a;
      let step = found.slope > 0 ? a - (found.depth - depth) / found.slope : low;
      if (!(low < step && step < high)) step = 0.5 * (low + high);
      if (Math.abs(step - a) <= LEAST.SAME * a) break;
      a = step;
    }
    return this.contact(a, this.at(a, place), place);
  }
  at(a, { plane, h, c, tilt, ...rest }) {
    const [sunk, steep, area, moment] = this.profile(a);
    const own = 1 - (2 / 3) * plane * h * a ** 3;
    if (own <= 0) return NONE;
    const force = (2 * plane * (a * sunk - area)) / own;
    const square = 4 * plane * ((a ** 3 / 3) * sunk - moment) + (4 / 15) * plane * h * force * a ** 5;
    const growth = 2 * plane * a * steep + 2 * plane * h * force * a ** 2;
    if (growth <= 0 || force <= 0) return NONE;
    const power = ((own / growth) * force) / a;
    const effect = (-2 / 3) * plane * tilt * a ** 3 * force * (2 + 3 * power);
    const depth = sunk + 0.5 * h * force * a ** 2 + c * force + 0.25 * h * square + effect;
    const compliance = tangent(a, { c, h, plane, ...rest }) + (effect * (1 + 3 * power)) / force;
    return { depth, slope: (compliance * growth) / own, force, square, growth, compliance };
  }
  contact(a, { force, square: moment, growth, compliance }, { plane, tilt, slopeC, slopeH, slopeTilt }) {
    const square = moment / force;
    const ofH = 0.25 * force ** 2 * square + ((4 / 3) * plane ** 2 * tilt * a ** 5 * force ** 3) / growth;
    const ofTilt = (-2 / 3) * plane * a ** 3 * force ** 2;
    const aside = [0, 1].map((i) => 0.5 * force ** 2 * slopeC[i] + ofH * slopeH[i] + ofTilt * slopeTilt[i]);
    return { force, aside, stiffness: 1 / compliance, radius: a, square };
  }
}

class Ball extends Round {
  constructor(radius) {
    super();
    Object.assign(this, { radius, limit: 0.6 * radius });
  }
  profile(s) {
    const t = (s / this.radius) ** 2;
    let power = t;
    const sums = [0, 0, 0, 0];
    for (let k = 0; k < LEAST.TERMS; k++) {
      const term = power / (2 * k + 1);
      sums[0] += term;
      sums[1] += (2 * k + 2) * term;
      sums[2] += term / (2 * k + 3);
      sums[3] += term / (2 * k + 5);
      if (term <= LEAST.NEGLIGIBLE * sums[0]) break;
      power *= t;
    }
    const { radius } = this;
    return [radius * sums[0], (radius / s) * sums[1], radius * s * sums[2], radius * s ** 3 * sums[3]];
  }
  first(depth) {
    return Math.sqrt(this.radius * depth);
  }
}

class Cone extends Round {
  constructor(angle, radius) {
    super();
    Object.assign(this, { limit: radius, rise: 1 / Math.tan(angle) });
  }
  profile(s) {
    const steep = 0.5 * Math.PI * this.rise;
    return [steep * s, steep, (steep * s ** 2) / 2, (steep * s ** 4) / 4];
  }
  first(depth) {
    return ((2 / Math.PI) * depth) / this.rise;
  }
}

// The tool of a query, or the status of one that is none.
function toolOf(name, radius, angle) {
  if (!["disc", "sphere", "cone"].includes(name)) return "tool";
  if (!Number.isFinite(radius) || (name === "cone" && !Number.isFinite(angle))) return "tool";
  if (radius < LEAST.SMALLEST || (name === "cone" && !(0.01 <= angle && angle <= Math.PI / 2 - 0.001))) return "input";
  return name === "disc" ? new Disc(radius) : name === "sphere" ? new Ball(radius) : new Cone(angle, radius);
}

const NOTHING = { force: [NaN, NaN, NaN], error: NaN, stiffness: NaN, radius: NaN };

class Model {
  constructor(told) {
    Object.assign(this, told); // origin, axes (rows x, y, outward), sides, thickness, young, poisson, largest, bar, off
    this.table = new Table(told);
  }
  local(at) {
    return this.axes.map((axis) => inner(axis, at.map((value, i) => value - this.origin[i])));
  }
  body(local) {
    return [0, 1, 2].map((i) => local.reduce((sum, value, row) => sum + value * this.axes[row][i], 0));
  }
  room(x, y) {
    const [a, b] = this.sides;
    if (this.is_round) return Math.min(a - Math.hypot(x, y), this.thickness);
    return Math.min(a - Math.abs(x), b - Math.abs(y), this.thickness);
  }
  query({ tool, radius = NaN, angle = NaN, at, depth, young = this.young, poisson = this.poisson }) {
    const refused = (status) => ({ status, ...NOTHING });
    const shape = toolOf(tool, radius, angle);
    if (typeof shape === "string") return refused(shape);
    const [x, y, z] = this.local(at);
    if (![x, y, z, depth, poisson].every(Number.isFinite) || !(young > 0 && young < Infinity)) return refused("input");
    if (!this.table.holds(x, y)) return refused("outside");
    if (Math.abs(z) > this.off) return refused("off");
    if (!(this.poisson_range[0] <= poisson && poisson <= this.poisson_range[1])) return refused("poisson");
    if (depth >= this.thickness) return refused("deep");
    if (depth <= LEAST.TOUCHING) return { status: "lost", force: [0, 0, 0], error: 0, stiffness: 0, radius: 0 };
    const [room, place] = [this.room(x, y), this.table.at(x, y, poisson)];
    if (!place) return refused("damaged");
    const contact = shape.press(depth, place, this.largest * room);
    if (!contact) return refused("large");
    const [ofC, ofH, beyond, ofF] = this.bar;
    const uncertain = (ofC + beyond * (contact.radius / room) ** 4) / room + ofH * Math.abs(place.h) * contact.square;
    const error = contact.stiffness * uncertain + ofF;
    const force = this.body([...contact.aside, contact.force].map((value) => young * value));
    const isRight = [...force, error].every(Number.isFinite) && contact.force > 0 && contact.stiffness > 0;
    if (!isRight) return refused("damaged");
    return { status: "ok", force, error, stiffness: young * contact.stiffness, radius: contact.radius };
  }
}
