// The forces of realtime/src/, in the same order and under the same names; SI units, E = 1 within.

const LEAST = {
  TOUCHING: 1e-12, SMALLEST: 1e-6, STEPS: 60, SAME: 4e-16, TERMS: 40, NEGLIGIBLE: 1e-17, SLENDER: 0.02, SOFT: 1e-12, STICKS: 0.1,
};

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

// c, h and g² at a place, with their slopes; and the face.
class Table {
  constructor(told) {
    // reciprocal, curvature (ν, v, u), tensors (7, ν, v, u), c_ref, reach, is_round, even, leans, poisson_range
    Object.assign(this, told);
  }
  holds(x, y) {
    const [a, b] = this.reach;
    return this.is_round ? x ** 2 + y ** 2 <= a ** 2 : Math.abs(x) <= a && Math.abs(y) <= b;
  }
  // Of coefficients (v, u): the value, its slope, and its second derivatives xx, xy, yy.
  local(flat, x, y) {
    const [a, b] = this.reach;
    const [evenX, evenY] = this.even;
    const u = this.is_round ? (2 * (x ** 2 + y ** 2)) / a ** 2 - 1 : evenX ? 2 * (x / a) ** 2 - 1 : x / a;
    const v = this.is_round ? 0 : evenY ? 2 * (y / b) ** 2 - 1 : y / b;
    const [left, right] = [polynomials(v, flat.length), polynomials(u, flat[0].length)];
    return this.slopes(left.map((row) => {
      const sums = flat[0].map((_, i) => row.reduce((sum, value, j) => sum + value * flat[j][i], 0));
      return right.map((column) => inner(column, sums));
    }), x, y);
  }
  at(x, y, poisson, whole) {
    const [across] = polynomials(middleOf(this.poisson_range, poisson), this.reciprocal.length);
    const along = (values) =>
      this.local(values[0].map((line, j) => line.map((_, i) => inner(across, values.map((of) => of[j][i])))), x, y);
    const [t, [tx, ty], [txx, txy, tyy]] = along(this.reciprocal);
    const [q, [qx, qy]] = along(this.curvature);
    if (!(t > 0)) return null;
    const slopeC = [-tx / t ** 2, -ty / t ** 2];
    const cxx = (2 * tx ** 2) / t ** 3 - txx / t ** 2;
    const cxy = (2 * tx * ty) / t ** 3 - txy / t ** 2;
    const cyy = (2 * ty ** 2) / t ** 3 - tyy / t ** 2;
    const lean = this.leans ? 1 : 0;
    const hessian = [[cxx, cxy], [cxy, cyy]].map((row) => row.map((value) => lean * value));
    return {
      c: 1 / t - this.c_ref, h: q / t ** 3, tilt: lean * 0.25 * (slopeC[0] ** 2 + slopeC[1] ** 2), slopeC, poisson,
      slopeH: [qx / t ** 3 - (3 * q * tx) / t ** 4, qy / t ** 3 - (3 * q * ty) / t ** 4],
      slopeTilt: hessian.map((row) => 0.5 * inner(row, slopeC)), hessian, lean: slopeC.map((value) => lean * value),
      plane: 1 / (1 - poisson ** 2), bend: 0, slopeBend: [0, 0],
      ...(whole ? this.shape(this.tensors.map(along), x, y, t, [tx, ty]) : {}),
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
  // A₁ and A_xy, their slopes, and R.
  shape(others, x, y, t, slopeT) {
    const known = this.factors(x, y);
    const values = others.map(([f], i) => known[i][0] * f);
    const slopes = others.map(([f, slope], i) => slope.map((value, k) => known[i][0] * value + f * known[i][1][k]));
    const bent = [0, 1].map((i) => values[i] / t ** 3);
    const bentSlopes = [0, 1].map((i) => slopes[i].map((value, k) => value / t ** 3 - (3 * bent[i] * slopeT[k]) / t));
    const [xz, yz, mean, half, xy] = values.slice(2).map((value) => value / t);
    return { bent, bentSlopes, regular: [[mean + half, xy, xz], [xy, mean - half, yz], [xz, yz, 1 / t - this.c_ref]] };
  }
  // What each of the seven tables is times, with its slope.
  factors(x, y) {
    const [a, b] = this.reach;
    const [xi, ofX] = this.even[0] ? [x / a, 1 / a] : [1, 0];
    const [eta, ofY] = this.even[1] ? [y / b, 1 / b] : [1, 0];
    const one = [1, [0, 0]];
    const twist = [2 * xi * eta, [2 * eta * ofX, 2 * xi * ofY]];
    const apart = this.is_round ? [xi ** 2 - eta ** 2, [2 * xi * ofX, -2 * eta * ofY]] : one;
    return [apart, twist, [xi, [ofX, 0]], [eta, [0, ofY]], one, apart, twist];
  }
}

// The face at a place: height, slope, second derivatives, mean curvature; and its own directions, the normal last.
class Spot {
  constructor(height, slope, [xx, xy, yy], bend, slopeBend) {
    const steep = Math.hypot(1, ...slope);
    const normal = [-slope[0] / steep, -slope[1] / steep, 1 / steep];
    const size = Math.hypot(normal[2], normal[0]);
    const first = [normal[2] / size, 0, -normal[0] / size];
    const second = [
      normal[1] * first[2] - normal[2] * first[1], normal[2] * first[0] - normal[0] * first[2],
      normal[0] * first[1] - normal[1] * first[0],
    ];
    Object.assign(this, { height, slope, steep, bend, slopeBend, bends: [[xx, xy], [xy, yy]], turn: [first, second, normal] });
  }
  // On a tool whose tip is at p - d n.
  force({ force, aside }, depth) {
    const { slope, steep, bends } = this;
    const metric = [0, 1].map((i) =>
      [0, 1].map((j) => (i === j ? 1 : 0) + slope[i] * slope[j] + (depth / steep) * bends[i][j]));
    const apart = metric[0][0] * metric[1][1] - metric[0][1] * metric[1][0];
    const [x, y] = [0, 1].map((i) => (metric[1 - i][1 - i] * aside[i] - metric[i][1 - i] * aside[1 - i]) / apart);
    return this.turn[2].map((value, i) => force * value + [x, y, slope[0] * x + slope[1] * y][i]);
  }
}

const NOTHING = { force: [NaN, NaN, NaN], error: NaN, stiffness: NaN, radius: NaN };

class Model {
  constructor(told) {
    // origin, axes (rows x, y, outward), sides, thickness, young, poisson, largest, bar, off, height, bend, bend_error
    Object.assign(this, told);
    this.table = new Table(told);
    this.isFlat = ![told.height, told.bend].flat(2).some((value) => value !== 0);
  }
  local(at) {
    return this.axes.map((axis) => inner(axis, at.map((value, i) => value - this.origin[i])));
  }
  body(local) {
    return [0, 1, 2].map((i) => local.reduce((sum, value, row) => sum + value * this.axes[row][i], 0));
  }
  spot(x, y) {
    if (this.isFlat) return new Spot(0, [0, 0], [0, 0, 0], 0, [0, 0]);
    const [bend, slopeBend] = this.table.local(this.bend, x, y);
    return new Spot(...this.table.local(this.height, x, y), bend, slopeBend);
  }
  room(x, y) {
    const [a, b] = this.sides;
    if (this.is_round) return Math.min(a - Math.hypot(x, y), this.thickness);
    return Math.min(a - Math.abs(x), b - Math.abs(y), this.thickness);
  }
  query(asked) {
    const { at, depth, young = this.young, poisson = this.poisson } = asked;
    const refused = (status) => ({ status, ...NOTHING });
    const shape = toolOf(asked, this);
    if (typeof shape === "string") return refused(shape);
    const [x, y, z] = this.local(at);
    if (![x, y, z, depth, poisson].every(Number.isFinite) || !(young > 0 && young < Infinity)) return refused("input");
    if (!this.table.holds(x, y)) return refused("outside");
    const spot = this.spot(x, y);
    if (Math.abs(z - spot.height) > this.off) return refused("off");
    if (!(this.poisson_range[0] <= poisson && poisson <= this.poisson_range[1])) return refused("poisson");
    if (depth >= this.thickness) return refused("deep");
    if (depth <= LEAST.TOUCHING) return { status: "lost", force: [0, 0, 0], error: 0, stiffness: 0, radius: 0 };
    const [room, place] = [this.room(x, y), this.table.at(x, y, poisson, shape.isWhole)];
    if (!place) return refused("damaged");
    if (!this.isFlat) Object.assign(place, { bend: spot.bend, slopeBend: spot.slopeBend });
    const contact = shape.press(depth, place, this.largest * room);
    if (!contact) return refused("large");
    const growth = shape instanceof Round ? Math.max((3 * contact.stiffness) / contact.force - 2 / depth, 0) : 0;
    const error = contact.stiffness * this.uncertain(place, room, contact, shape) + this.bar[3]
      + (this.bend_error / 2) * contact.square * growth;
    const force = this.body(spot.force(contact, depth).map((value) => young * value));
    const isRight = [...force, error].every(Number.isFinite) && error >= 0 && contact.force > 0 && contact.stiffness > 0;
    if (!isRight) return refused("damaged");
    return { status: "ok", force, error, stiffness: young * contact.stiffness, radius: contact.radius, spot, shape };
  }
  // How far c may be off, what is left out of it included.
  uncertain(place, room, { radius, square }, shape) {
    const [ofC, ofH, beyond] = this.bar;
    const bent = Math.abs(place.h) + (place.bent ? 2 * Math.hypot(...place.bent) : 0);
    const pulled = shape instanceof Bonded ? (LEAST.STICKS * (1 - 2 * place.poisson) * radius) / room : 0;
    return (ofC + beyond * (radius / room) ** 4 + pulled) / room + ofH * bent * square;
  }
}
