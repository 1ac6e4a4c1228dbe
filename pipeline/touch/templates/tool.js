// Shapes that are no part of the body: the tool, and the arrow of its force. Lengths in mm, along the face's axes.

const ROUND = Array.from({ length: 41 }, (_, i) => [Math.cos((Math.PI * i) / 20), Math.sin((Math.PI * i) / 20)]);
const INSIDE = [1, 1, 1]; // no edge is near

// Turn a line of (ρ, z) round the z axis through (x, y), moved along it by `down`.
function turned(made, line, [x, y], down, kind, value = 0) {
  const put = ([rho, z], [c, s]) => {
    const first = made.further();
    made.data.set([x + rho * c, y + rho * s, z, 0, 0, down, value, kind, ...INSIDE], first);
  };
  for (let i = 1; i < line.length; i++) {
    for (let k = 1; k < ROUND.length; k++) {
      const [a, b, p, q] = [line[i - 1], line[i], ROUND[k - 1], ROUND[k]];
      for (const [end, side] of [[a, p], [b, p], [b, q], [b, q], [a, q], [a, p]]) put(end, side);
    }
  }
}

// The tool above its lowest point, with a shaft.
function profileOf(tool, radius, angle) {
  const long = 4 * radius;
  // A little above the face, which it would else fight with for the same pixels.
  if (tool === "disc") return [[0, 0.02 * radius], [radius, 0.02 * radius], [radius, long]];
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
    made.data.set([...place, 0, 0, 0, 1, PROBE, ...INSIDE], made.further());
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
