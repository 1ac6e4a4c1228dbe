// What is seen of a touch: pipeline/epsmesh_realtime/c/src/surface.c, with triangles made smaller near the tool.

// Edges near the tool are divided until they are shorter than this share of the contact's radius and of the way to its rim, and
// until none crosses the rim; so many vertices are added at most. In units of the contact's radius: what is on the rim, and the
// longest edge between two points of the rim that is divided on it.
const SEEN = { FINE: 0.07, LEVELS: 9, ADDED: 30000, ON_RIM: 1e-3, ALONG: 0.8 };
// Bisections of an edge for the point where it crosses the rim.
const BISECTIONS = 12;

// Where the tool presses: a disc of radius `a`, or a rectangle, in the face's own directions.
class Footprint {
  constructor({ tool, length, width }, { radius }, along) {
    Object.assign(this, { a: radius, reach: radius, half: null });
    if (tool !== "blade") return;
    const turn = Math.hypot(...along);
    this.edge = turn > 0 ? along.map((part) => part / turn) : [1, 0];
    this.half = [length / 2, width / 2];
    this.a = Math.min(...this.half);
  }
  // The distance of a point to the rim of the contact, negative within.
  beyond(x, y, z) {
    if (!this.half) return Math.hypot(x, y, z) - this.a;
    const [c, s] = this.edge;
    const [p, q] = [Math.abs(c * x + s * y) - this.half[0], Math.abs(c * y - s * x) - this.half[1]];
    return p <= 0 && q <= 0 ? Math.max(p, q) : Math.hypot(Math.max(p, 0), Math.max(q, 0), z);
  }
}

// Where a number that grows from less to more than 0 between 0 and 1 is 0.
function crossing(grows) {
  let [low, high] = [0, 1];
  for (let i = 0; i < BISECTIONS; i++) {
    const middle = (low + high) / 2;
    if (grows(middle) < 0) low = middle;
    else high = middle;
  }
  return (low + high) / 2;
}

// Move a point, and its place from the tool in the face's directions, along the face to a distance from the tool's axis.
function outTo(place, [px, py, pz], turn, distance) {
  const far = Math.hypot(px, py);
  const more = Math.sqrt(Math.max(distance ** 2 - pz ** 2, 0)) / far - 1;
  for (let i = 0; i < 3; i++) place[i] += more * (px * turn[0][i] + py * turn[1][i]);
}

class Surface {
  // Points at rest, their regular parts, and their displacements: in the evaluator's memory, with those put between.
  constructor(model) {
    const { c } = model;
    const [n, m] = [c.page_vertices(), c.page_triangles()];
    const most = n + SEEN.ADDED;
    const rooms = [0, 1, 2].map(() => c.page_room(3 * 8 * most));
    const [rest, regular, moved] = rooms.map((at) => model.numbers(at, 3 * most));
    Object.assign(this, { model, n, m, most, rooms, rest, regular, moved });
    rest.set(new Float32Array(c.memory.buffer, c.page_points(), 3 * n));
    this.triangles = new Int32Array(c.memory.buffer, c.page_corners(), 3 * m);
    this.away = new Float64Array(most);
    this.shown = new Int32Array(3 * (m + 2 * SEEN.ADDED)); // each new vertex makes two triangles more at most
    this.spans = Float64Array.from({ length: m }, (_, t) => this.spanOf(t));
  }
  // The longest edge of a triangle.
  spanOf(t) {
    const corners = [0, 1, 2].map((j) => 3 * this.triangles[3 * t + j]);
    const edge = (p, q) => Math.hypot(...[0, 1, 2].map((i) => this.rest[p + i] - this.rest[q + i]));
    return Math.max(...corners.map((p, j) => edge(p, corners[(j + 1) % 3])));
  }
  // Put into `moved` the displacement of all vertices after a query, local; return the triangles (flat) that show it.
  press(query, touch, refine) {
    const { model, n } = this;
    const place = model.local(query.at);
    const along = [0, 1].map((i) => inner(model.axes[i], query.along || [0, 0, 0]));
    this.far();
    const { turn } = model.spot(...place);
    const { triangles, count } = refine
      ? this.refined(place, turn, new Footprint(query, touch, along)) : { triangles: null, count: n };
    this.move(count);
    return triangles;
  }
  far() {
    this.model.c.page_regular(this.rooms[1]);
  }
  move(count) {
    this.model.c.page_move(count, ...this.rooms);
  }
  // Divide edges by their own length and place alone, so that neighbours agree.
  refined([x, y, z], turn, foot) {
    const { rest, regular, n, m, most } = this;
    let count = n;
    const between = new Map();
    const [along, across, up] = turn;
    const local = (px, py, pz, unit) => (px - x) * unit[0] + (py - y) * unit[1] + (pz - z) * unit[2];
    const beyond = (px, py, pz) => foot.beyond(local(px, py, pz, along), local(px, py, pz, across), local(px, py, pz, up));
    const known = this.away.fill(NaN);
    const beyondOf = (v) => {
      if (Number.isNaN(known[v])) known[v] = beyond(rest[3 * v], rest[3 * v + 1], rest[3 * v + 2]);
      return known[v];
    };
    const isOnRim = (far) => Math.abs(far) <= SEEN.ON_RIM * foot.a;
    // The vertex that divides an edge, -1 if it is short and does not cross the rim.
    const middle = (p, q) => {
      const key = Math.min(p, q) * most + Math.max(p, q);
      if (between.has(key)) return between.get(key);
      const [px, py, pz] = [rest[3 * p], rest[3 * p + 1], rest[3 * p + 2]];
      const [dx, dy, dz] = [rest[3 * q] - px, rest[3 * q + 1] - py, rest[3 * q + 2] - pz];
      const length = Math.hypot(dx, dy, dz);
      const away = Math.abs(beyond(px + dx / 2, py + dy / 2, pz + dz / 2));
      const isLong = length > SEEN.FINE * Math.max(foot.a, away) + 0.5 * away;
      const [first, last] = away <= length ? [beyondOf(p), beyondOf(q)] : [1, 1];
      const crosses = first * last < 0 && !isOnRim(first) && !isOnRim(last);
      let found = -1;
      if ((isLong || crosses) && count < most) {
        found = count++;
        const share = crosses ? crossing((t) => beyond(px + t * dx, py + t * dy, pz + t * dz) * Math.sign(last)) : 0.5;
        const place = [px + share * dx, py + share * dy, pz + share * dz];
        if (isOnRim(first) && isOnRim(last) && !foot.half && length < SEEN.ALONG * foot.a) {
          outTo(place, turn.map((unit) => local(...place, unit)), turn, foot.a);
        }
        rest.set(place, 3 * found);
        for (let i = 0; i < 3; i++) regular[3 * found + i] = (1 - share) * regular[3 * p + i] + share * regular[3 * q + i];
      }
      between.set(key, found);
      return found;
    };
    let now = [];
    const { triangles, spans, shown: done } = this;
    let size = 0;
    for (let t = 0; t < m; t++) {
      const p = triangles[3 * t];
      const [dx, dy, dz] = [rest[3 * p] - x, rest[3 * p + 1] - y, rest[3 * p + 2] - z];
      // No edge of a triangle so far away is halved.
      const near = 3 * spans[t] + foot.reach;
      if (dx * dx + dy * dy + dz * dz < near * near) now.push(p, triangles[3 * t + 1], triangles[3 * t + 2]);
      else for (let j = 0; j < 3; j++) done[size++] = triangles[3 * t + j];
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
