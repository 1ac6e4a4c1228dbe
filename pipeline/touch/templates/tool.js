// Shapes that are no part of the body: the tool, and the arrow of its force. Lengths in mm, along the face's axes.

const ROUND = Array.from({ length: 41 }, (_, i) => [Math.cos((Math.PI * i) / 20), Math.sin((Math.PI * i) / 20)]);
const INSIDE = [1, 1, 1]; // no edge is near

// Put a point of the tool, in its own axes, above where it touches: `at` (mm), `turn` its axes, `down` how far it moves.
function hold(made, own, { at, turn, down }) {
  const place = own.reduce((sum, value, i) => along(sum, value, turn[i]), at);
  const first = made.further(); // which may put other data in the place of this
  made.data.set([...place, ...turn[2].map((value) => down * value), 0, TOOL, ...INSIDE], first);
}

// Turn a line of (ρ, z) round the tool's axis.
function turned(made, line, place) {
  const put = ([rho, z], [c, s]) => hold(made, [rho * c, rho * s, z], place);
  for (let i = 1; i < line.length; i++) {
    for (let k = 1; k < ROUND.length; k++) {
      const [a, b, p, q] = [line[i - 1], line[i], ROUND[k - 1], ROUND[k]];
      for (const [end, side] of [[a, p], [b, p], [b, q], [b, q], [a, q], [a, p]]) put(end, side);
    }
  }
}

// A blade of half sides, its edge turned by an angle about the tool's axis.
function block(made, [long, short], angle, place) {
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  const [low, high] = [0.02 * short, 2 * long];
  const corner = (x, y, z) => hold(made, [c * x * long - s * y * short, s * x * long + c * y * short, z], place);
  const ring = [[-1, -1], [1, -1], [1, 1], [-1, 1]];
  ring.forEach(([x, y], i) => {
    const [p, q] = ring[(i + 1) % 4];
    for (const [a, b, z] of [[x, y, low], [p, q, low], [p, q, high], [p, q, high], [x, y, high], [x, y, low]]) corner(a, b, z);
  });
  for (const z of [low, high]) for (const i of [0, 1, 2, 0, 2, 3]) corner(...ring[i], z);
}

// The tool above its lowest point, with a shaft; a disc has the mean curvature of the face.
function profileOf(tool, radius, angle, bend) {
  const long = 4 * radius;
  if (tool === "disc") {
    // A little above the face, which it would else fight with for the same pixels.
    const flat = [0, 0.25, 0.5, 0.75, 1].map((share) => [share * radius, (0.02 - 0.5 * bend * radius * share ** 2) * radius]);
    return [...flat, [radius, long]];
  }
  if (tool === "cone") return [[0, 0], [radius, radius / Math.tan(angle)], [radius, radius / Math.tan(angle) + long]];
  const ball = Array.from({ length: 17 }, (_, i) => (Math.PI * i) / 20);
  const round = ball.map((t) => [radius * Math.sin(t), radius * (1 - Math.cos(t))]);
  return [...round, [round.at(-1)[0], round.at(-1)[1] + long]];
}

// Put an arrow of a length from `foot` in a direction; a whisker reaches from 1 - error to 1 + error of its length.
function arrow(made, foot, direction, length, error, thick) {
  const [u, v] = (() => {
    const other = Math.abs(direction[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0];
    const first = cross(direction, other);
    const unit = first.map((value) => value / Math.hypot(...first));
    return [unit, cross(direction, unit)];
  })();
  const put = (rho, z, [c, s]) => {
    const place = along(along(along(foot, z, direction), rho * c, u), rho * s, v);
    const first = made.further();
    made.data.set([...place, 0, 0, 0, 1, PROBE, ...INSIDE], first);
  };
  const line = (points) => {
    for (let i = 1; i < points.length; i++) {
      for (let k = 1; k < ROUND.length; k++) {
        const [[ra, za], [rb, zb], p, q] = [points[i - 1], points[i], ROUND[k - 1], ROUND[k]];
        for (const [rho, z, side] of [[ra, za, p], [rb, zb, p], [rb, zb, q], [rb, zb, q], [ra, za, q], [ra, za, p]]) {
          put(rho, z, side);
        }
      }
    }
  };
  const head = Math.min(4 * thick, length);
  line([[thick, 0], [thick, length - head], [2.2 * thick, length - head], [0, length]]);
  const half = error * length;
  const cap = [2.6 * thick, 0.25 * thick];
  for (const z of [length - half, length + half]) line([[0, z - cap[1]], [cap[0], z - cap[1]], [cap[0], z + cap[1]], [0, z + cap[1]]]);
  line([[0.4 * thick, length - half], [0.4 * thick, length + half]]);
}
