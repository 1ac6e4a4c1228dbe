// What is seen of a touch: realtime/src/surface.c, with triangles made smaller near the tool.

// Edges near the tool are halved until they are shorter than this share of the contact's radius and of the way to its edge; so many
// vertices are added at most.
const SEEN = { FINE: 0.18, LEVELS: 6, ADDED: 30000 };

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
  // How far a point is from the edge of the contact.
  away(x, y, z) {
    if (!this.half) return Math.abs(Math.hypot(x, y, z) - this.a);
    const [c, s] = this.edge;
    const [p, q] = [Math.abs(c * x + s * y) - this.half[0], Math.abs(c * y - s * x) - this.half[1]];
    return p <= 0 && q <= 0 ? -Math.max(p, q) : Math.hypot(Math.max(p, 0), Math.max(q, 0), z);
  }
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
  // Halve edges by their own length and place alone, so that neighbours agree.
  refined([x, y, z], turn, foot) {
    const { rest, regular, n, m, most } = this;
    let count = n;
    const between = new Map();
    const middle = (p, q) => {
      const key = Math.min(p, q) * most + Math.max(p, q);
      if (between.has(key)) return between.get(key);
      const [mx, my, mz] = [0, 1, 2].map((i) => (rest[3 * p + i] + rest[3 * q + i]) / 2);
      const length = Math.hypot(...[0, 1, 2].map((i) => rest[3 * p + i] - rest[3 * q + i]));
      const away = foot.away(...turn.map((unit) => inner(unit, [mx - x, my - y, mz - z])));
      let found = -1;
      if (length > SEEN.FINE * Math.max(foot.a, away) + 0.5 * away && count < most) {
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
