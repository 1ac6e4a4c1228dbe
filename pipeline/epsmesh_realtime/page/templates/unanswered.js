// The places where the model has no answer for the chosen tool, shaded before one gets there.

// Cells along each direction of the face. A tool that does not touch is asked for at this depth, in units of the body's size.
const CELLS = 48;
const SHALLOW = 1e-6;

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
    const depth = Math.max(query.depth, SHALLOW * this.page.size / MM);
    const found = this.statuses({ ...query, depth });
    this.page.stage.fill(this.outside, this.geometry(found.filter(([status]) => status === "outside")));
    this.page.stage.fill(this.other, this.geometry(found.filter(([status]) => status !== "outside" && status !== "ok")));
    const counts = {};
    for (const [status] of found) counts[status] = (counts[status] || 0) + 1 / found.length;
    this.shares = counts;
    return counts;
  }
  // The status of a tool in the middle of each cell of the face, with the cell's corner and sizes, in m.
  statuses(query) {
    const { model } = this.page;
    const [a, b] = model.is_flat ? model.sides : model.reach;
    const found = [];
    for (let i = 0; i < CELLS; i++) {
      for (let j = 0; j < CELLS; j++) {
        const [u, v] = [(2 * a * i) / CELLS - a, (2 * b * j) / CELLS - b];
        const [x, y] = [u + a / CELLS, v + b / CELLS];
        if (model.is_round && Math.hypot(x, y) > a) continue;
        const at = model.body([x, y, this.page.heightAt(MM * x, MM * y) / MM]).map((part, k) => part + model.origin[k]);
        found.push([model.query({ ...query, at }).status, u, v, (2 * a) / CELLS, (2 * b) / CELLS]);
      }
    }
    return found;
  }
  // Two triangles for each cell, a little above the face.
  geometry(cells) {
    const points = cells.flatMap(([, u, v, wide, long]) => {
      const corners = [[0, 0], [1, 0], [1, 1], [0, 1]].map(([i, j]) => this.above(MM * (u + i * wide), MM * (v + j * long)));
      return [0, 1, 2, 0, 2, 3].map((k) => corners[k]);
    });
    return new THREE.BufferGeometry().setFromPoints(points);
  }
  above(x, y) {
    const { page } = this;
    return vector([x, y, page.heightAt(x, y) + ABOVE * page.size]);
  }
}
