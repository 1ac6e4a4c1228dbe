// What tools do to a body: realtime/src/contact.c.

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
  at(a, { plane, h, c, tilt, bend, ...rest }) {
    let [sunk, steep, area, moment] = this.profile(a);
    // A dome is met by a tool that is as much sharper.
    [sunk, steep] = [sunk + bend * a ** 2, steep + 2 * bend * a];
    [area, moment] = [area + (bend * a ** 3) / 3, moment + (bend * a ** 5) / 5];
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
  contact(a, { force, square: moment, growth, compliance }, { plane, tilt, slopeC, slopeH, slopeTilt, slopeBend }) {
    const square = moment / force;
    const ofH = 0.25 * force ** 2 * square + ((4 / 3) * plane ** 2 * tilt * a ** 5 * force ** 3) / growth;
    const ofTilt = (-2 / 3) * plane * a ** 3 * force ** 2;
    const aside = [0, 1].map((i) =>
      0.5 * force ** 2 * slopeC[i] + ofH * slopeH[i] + ofTilt * slopeTilt[i] + 0.5 * moment * slopeBend[i]);
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

class Blade {
  // Half length, half width, the angle of its edge to x, and Chebyshev coefficients (terms, 5) of rectangles.
  constructor(length, width, turn, rectangle) {
    const at = 1 - (2 * Math.log(width / length)) / Math.log(LEAST.SLENDER);
    const [values] = polynomials(at, rectangle.length);
    const numbers = rectangle[0].map((_, i) => values.reduce((sum, value, n) => sum + value * rectangle[n][i], 0));
    Object.assign(this, { length, width, turn, numbers, isWhole: true });
    this.edge = [Math.cos(turn), Math.sin(turn)];
    this.spread = [numbers[1] * length ** 2, numbers[2] * width ** 2];
  }
  press(depth, { c, h, plane, slopeC, slopeH, bent, bentSlopes, lean, hessian }, most) {
    const { length: long, width: short, turn, edge } = this;
    const [force, , , leanAlong, leanAcross] = this.numbers;
    const [along, across] = this.spread;
    if (Math.hypot(long, short) > most) return null;
    const leans = [plane * leanAlong * long ** 2.5 * short ** 0.5, plane * leanAcross * short ** 2 * long];
    const double = [Math.cos(2 * turn), Math.sin(2 * turn)];
    const [mean, half] = [(along + across) / 2, along - across];
    let soft = 1 / (plane * force * 2 * Math.sqrt(long * short)) + c + mean * h + half * inner(double, bent);
    const ofPlace = [0, 1].map((i) => slopeC[i] + mean * slopeH[i] + half * inner(double, bentSlopes.map((row) => row[i])));
    [edge, [-edge[1], edge[0]]].forEach((direction, k) => {
      const slope = inner(lean, direction);
      soft -= (leans[k] * slope ** 2) / 4;
      for (let i = 0; i < 2; i++) ofPlace[i] -= (leans[k] / 2) * slope * inner(hessian[i], direction);
    });
    const push = depth / soft;
    const aside = ofPlace.map((value) => 0.5 * push ** 2 * value);
    return { force: push, aside, stiffness: 1 / soft, radius: Math.hypot(long, short), square: along + across };
  }
}

class Bonded {
  constructor(radius) {
    Object.assign(this, { radius, isWhole: true });
  }
  press(depth, { h, poisson, regular }, most) {
    const { radius: a } = this;
    if (a > most) return null;
    const shear = 0.5 / (1 + poisson);
    const soft = 1 - 2 * poisson;
    const down = 4 * shear * a * (soft > LEAST.SOFT ? Math.log1p(2 * soft) / soft : 2);
    const aside = (8 * shear * a) / (2 - poisson);
    const own = [1 / aside, 1 / aside, 1 / down + (a ** 2 / 3) * h];
    const m = regular.map((row, i) => row.map((value, j) => value + (i === j ? own[i] : 0)));
    // The last column of the inverse.
    const minor = (i, j, k, l) => m[i][j] * m[k][l] - m[i][l] * m[k][j];
    const column = [minor(0, 1, 1, 2), -minor(0, 0, 1, 2), minor(0, 0, 1, 1)];
    const scale = depth / inner(m[2], column);
    const [x, y, force] = column.map((value) => scale * value);
    return { force, aside: [x, y], stiffness: force / depth, radius: a, square: (2 / 3) * a ** 2 };
  }
}

// The tool of a query, or the status of one that is none, or that the model has no tables for.
function toolOf({ tool, contact, radius = NaN, angle = NaN, length = NaN, width = NaN, along = null }, model) {
  const known = { disc: ["frictionless", "bonded"], blade: ["frictionless"], sphere: ["unilateral"], cone: ["unilateral"] };
  if (!known[tool] || (contact !== undefined && !known[tool].includes(contact))) return "tool";
  if ((tool === "blade" || contact === "bonded") && !model.tensors.length) return "tool";
  if (tool === "blade") {
    if (![length, width].every(Number.isFinite)) return "tool";
    if (Math.min(length, width) < LEAST.SMALLEST) return "input";
    const edge = along === null ? [1, 0] : model.axes.slice(0, 2).map((axis) => inner(axis, along));
    if (!(Math.hypot(...edge) > 0 && Math.hypot(...edge) < Infinity)) return "input";
    const [long, short] = [Math.max(length, width) / 2, Math.min(length, width) / 2];
    if (short < LEAST.SLENDER * long) return "tool";
    const turn = Math.atan2(edge[1], edge[0]);
    return new Blade(long, short, length >= width ? turn : turn + Math.PI / 2, model.rectangle);
  }
  if (!Number.isFinite(radius) || (tool === "cone" && !Number.isFinite(angle))) return "tool";
  if (radius < LEAST.SMALLEST || (tool === "cone" && !(0.01 <= angle && angle <= Math.PI / 2 - 0.001))) return "input";
  if (tool === "disc") return contact === "bonded" ? new Bonded(radius) : new Disc(radius);
  return tool === "sphere" ? new Ball(radius) : new Cone(angle, radius);
}
