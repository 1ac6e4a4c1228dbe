// What is seen next to a tool: realtime/src/surface.c.

const MOMENTS = { disc: 2 / 3, sphere: 2 / 5, cone: 1 / 3 };
const NEAR = { AXIS: 1e-6, NEXT: 4, STEEP: 1, OVER: 0.95, BOWED: 0.7, APART: 1.2, FEWEST: 4, MOST: 24 };

// Where a tool presses: a kind of pressure and its radius, at centres, in equal parts.
class Footprint {
  constructor(shape, radius) {
    const kind = shape instanceof Ball ? "sphere" : shape instanceof Cone ? "cone" : "disc";
    Object.assign(this, { shape, kind, a: radius, centres: [[0, 0]], reach: radius, sticks: shape instanceof Bonded });
    const half = 0.5 * MOMENTS[kind] * radius ** 2;
    this.spread = [[half, 0], [0, half]];
    if (shape instanceof Blade) this.ofBlade(shape);
    this.square = this.spread[0][0] + this.spread[1][1];
    this.at = new Float64Array(3); // what the last call found
  }
  ofBlade({ length, width, edge, spread: [along, across] }) {
    this.a = width;
    const count = Math.min(Math.max(Math.ceil((2 * length) / (NEAR.APART * width)), NEAR.FEWEST), NEAR.MOST);
    const reach = Math.sqrt(2 * Math.max(along - this.a ** 2 / 3, 0));
    this.centres = Array.from({ length: count }, (_, k) => {
      const place = reach * Math.cos((Math.PI * (k + 0.5)) / count);
      return edge.map((value) => place * value);
    });
    const [c, s] = edge;
    const twist = (along - across) * c * s;
    this.spread = [[along * c * c + across * s * s, twist], [twist, along * s * s + across * c * c]];
    this.reach = Math.hypot(length, width);
  }
  // Whether a point is below the tool.
  holds(x, y, z) {
    if (x * x + y * y > this.reach * this.reach || Math.abs(z) > NEAR.BOWED * this.reach) return false;
    if (this.centres.length === 1) return true;
    const { length, width, edge: [c, s] } = this.shape;
    return Math.abs(c * x + s * y) <= length && Math.abs(c * y - s * x) <= width;
  }
  // How far a point is from the edge of the contact.
  away(x, y, z) {
    if (this.centres.length === 1) return Math.abs(Math.hypot(x, y, z) - this.a);
    const { length, width, edge: [c, s] } = this.shape;
    const [p, q] = [Math.abs(c * x + s * y) - length, Math.abs(c * y - s * x) - width];
    return p <= 0 && q <= 0 ? -Math.max(p, q) : Math.hypot(Math.max(p, 0), Math.max(q, 0), z);
  }
  // By how much more than its lowest point the tool moves such a point up.
  lifted(x, y, z) {
    if (this.kind === "sphere") {
      const { radius } = this.shape;
      return radius - Math.sqrt(Math.max(radius * radius - x * x - y * y, 0)) - z;
    }
    return this.kind === "cone" ? this.shape.rise * Math.sqrt(x * x + y * y) - z : 0;
  }
  // Make ready for a Poisson's ratio, and for what counts as the plane.
  prepare(poisson, flat) {
    this.soft = 1 - 2 * poisson;
    this.unit = (1 + poisson) / (2 * Math.PI);
    this.sunk = SUNK[this.kind](this.a, 1 / (1 - poisson ** 2));
    this.within = WITHIN[this.kind];
    this.flat = flat;
  }
  // Put the displacement for a force of one into `at`.
  field(x, y, z) {
    const { at } = this;
    const across = x * x + y * y;
    if (Math.abs(z) <= this.flat) return this.onPlane(x, y, 0);
    this.boussinesq(x, y, z);
    const next = NEAR.NEXT * this.reach;
    if (across + z * z > next * next || z * z > NEAR.STEEP * NEAR.STEEP * across) return undefined;
    const [dx, dy, dz] = at;
    this.boussinesq(x, y, 0);
    const [lx, ly, lz] = at;
    this.onPlane(x, y);
    at[0] += dx - lx;
    at[1] += dy - ly;
    at[2] += dz - lz;
    return undefined;
  }
  onPlane(x, y) {
    const { at, centres } = this;
    const next = NEAR.NEXT * this.reach;
    if (centres.length > 1 && x * x + y * y > next * next) return this.boussinesq(x, y, 0);
    at.fill(0);
    for (let k = 0; k < centres.length; k++) this.onFace(x - centres[k][0], y - centres[k][1]);
    for (let i = 0; i < 3; i++) at[i] /= centres.length;
    return undefined;
  }
  onFace(x, y) {
    const { a, at } = this;
    const rho = Math.max(Math.sqrt(x * x + y * y), NEAR.AXIS * a);
    const near = Math.min(rho / a, 1);
    let share = this.within(near, Math.sqrt(1 - near * near));
    if (this.sticks) share *= Math.max(1 - (a / rho) ** 2, 0);
    const aside = (-this.soft * this.unit * share) / (rho * rho);
    at[0] += aside * x;
    at[1] += aside * y;
    at[2] -= this.sunk(Math.max(rho, a));
  }
  boussinesq(x, y, z) {
    const { at, soft, unit, square } = this;
    const flat = x * x + y * y;
    const one = 1 / Math.sqrt(Math.max(flat + z * z, square));
    const under = Math.max(-z, -NEAR.OVER / one);
    const third = one * one * one;
    const fifth = third * one * one;
    const bend = 15 * flat * one * one;
    const quarter = square / 4;
    let aside = under * third - (soft * one) / (1 / one + under);
    aside = unit * (aside + quarter * fifth * under * (bend - 12 + 3 * soft));
    let down = under * under * third + (1 + soft) * one;
    const turned = 1 - 3 * under * under * one * one;
    down += quarter * (under * under * fifth * (bend - 6) + (1 + soft) * third * turned);
    at[0] = aside * x;
    at[1] = aside * y;
    at[2] = -unit * down;
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
