// The places where the model has no answer for the chosen tool, shaded before one gets there.

// Cells along each direction of the face, and bisections of an edge of a cell for the border that crosses it. A tool that
// does not touch is asked for at this depth, in units of the body's size.
const CELLS = 48;
const HALVINGS = 5;
// The border of a curved face belongs to the region, but for rounding.
const WITHIN = 1 - 1e-6;
const SHALLOW = 1e-6;
const CORNERS_OF_CELL = [[0, 0], [1, 0], [1, 1], [0, 1]];
const isOutside = (status) => status === "outside";
const isOther = (status) => Boolean(status) && status !== "ok" && !isOutside(status);

class Unanswered {
  // Parts of the stage by status: what is outside the region, and all else.
  constructor(page) {
    const { stage, inputs } = page;
    Object.assign(this, { page, outside: stage.addSolid(inputs.ink.held, 0.4), other: stage.addSolid(inputs.ink.footprint, 0.35) });
    this.seen = "";
  }
  // Shade again if the tool has changed; its place and E do not matter. Return the statuses with their shares of the face.
  update(query) {
    const { at, young, ...tool } = query;
    const key = JSON.stringify(tool);
    if (key === this.seen) return this.shares;
    this.seen = key;
    const asked = { ...query, depth: Math.max(query.depth, SHALLOW * this.page.size / MM) };
    const found = this.statuses(asked);
    for (const [part, isIn] of [[this.outside, isOutside], [this.other, isOther]]) {
      this.page.stage.fill(part, this.geometry(asked, found, isIn));
    }
    const counts = {};
    const on = found.map(([status]) => status).filter(Boolean);
    for (const status of on) counts[status] = (counts[status] || 0) + 1 / on.length;
    this.shares = counts;
    return counts;
  }
  // The status of a tool at a place of the face (m), "" beside a round face.
  status(query, x, y) {
    const { model } = this.page;
    if (model.is_round && Math.hypot(x, y) > (model.is_flat ? model.sides : model.reach)[0]) return "";
    const at = model.body([x, y, this.page.heightAt(MM * x, MM * y) / MM]).map((part, k) => part + model.origin[k]);
    return model.query({ ...query, at }).status;
  }
  // The status at each corner of the cells, with its place, in m: rows of x.
  statuses(query) {
    const { model } = this.page;
    const [a, b] = model.is_flat ? model.sides : model.reach;
    const places = Array.from({ length: CELLS + 1 }, (_, i) => WITHIN * ((2 * i) / CELLS - 1));
    return places.flatMap((v) => places.map((u) => [this.status(query, a * u, b * v), a * u, b * v]));
  }
  // The polygons of the cells where statuses are such, which end where the status changes; a little above the face.
  geometry(query, found, isIn) {
    const points = [];
    for (let cell = 0; cell < CELLS * CELLS; cell++) {
      const [i, j] = [cell % CELLS, Math.floor(cell / CELLS)];
      const corners = CORNERS_OF_CELL.map(([p, q]) => found[(j + q) * (CELLS + 1) + i + p]);
      const polygon = corners.flatMap((corner, k) => {
        const next = corners[(k + 1) % 4];
        const here = isIn(corner[0]);
        return [...(here ? [corner] : []), ...(here === isIn(next[0]) ? [] : [this.border(query, corner, next, isIn)])];
      });
      const above = polygon.map(([, x, y]) => this.above(MM * x, MM * y));
      for (let k = 2; k < above.length; k++) points.push(above[0], above[k - 1], above[k]);
    }
    return new THREE.BufferGeometry().setFromPoints(points);
  }
  // Where between two places the status changes.
  border(query, from, to, isIn) {
    const here = isIn(from[0]);
    let [low, high] = [from, to];
    for (let i = 0; i < HALVINGS; i++) {
      const [x, y] = [(low[1] + high[1]) / 2, (low[2] + high[2]) / 2];
      const middle = [this.status(query, x, y), x, y];
      if (isIn(middle[0]) === here) low = middle;
      else high = middle;
    }
    return here ? low : high;
  }
  above(x, y) {
    const { page } = this;
    return vector([x, y, page.heightAt(x, y) + ABOVE * page.size]);
  }
}
