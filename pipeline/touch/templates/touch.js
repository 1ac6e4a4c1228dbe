// The page: a hand that moves the tool, and what it feels.

const field = (name) => document.querySelector(`[name=${name}]`);
const say = (id, text) => {
  document.getElementById(id).textContent = text;
};
const short = (value, digits = 3) => String(Number(value.toPrecision(digits)));
const MM = 1e3;
const DEGREE = Math.PI / 180;
// The arrow of the largest force so far is this share of the body's size; arrows are this thick.
const ARROW = 0.35;
const THICK = 0.008;
// The error bar that fills its gauge.
const DOUBT = 0.05;
// Steps along the eye's ray, and halvings of the last one, that find where it meets a face that is not flat.
const STEPS = 60;
const HALVINGS = 30;
// Points along the border of the region, so far above the face, in units of the body's size.
const BORDER = 200;
const ABOVE = 0.002;
// What is asked for by one tool, or by all but one.
const OF_ONE = { angle: "cone", length: "blade", width: "blade", turn: "blade" };

class Page {
  constructor(told, arrays, gl) {
    this.told = told;
    this.model = new Model(told.model);
    this.surface = new Surface(this.model, arrays, told.shape);
    this.canvas = gl.canvas;
    this.made = new Vertices();
    this.heights = this.findHeights();
    this.scene = new Scene(gl, told.ink);
    this.scene.colour({ stops: told.stops, labels: null });
    this.largest = 0;
    this.size = told.radius;
    this.scene.outline.fill(linesOf([this.border()]));
    this.listen();
    this.camera = new Camera(gl.canvas, told.eye, told.radius, 1e-3 * told.radius);
    this.camera.listen(() => this.redraw());
    this.camera.look(told.centre, 0);
    if (innerWidth < 600) document.getElementById("panel").open = false;
    this.whole();
  }
  listen() {
    for (const { name } of document.querySelectorAll("#panel [name]")) {
      field(name).addEventListener("input", () => this.redraw());
    }
    field("whole").addEventListener("click", () => this.whole());
    addEventListener("resize", () => this.redraw());
    const { canvas } = this;
    let held = null;
    // Before the camera's own: what begins on the face moves the tool.
    canvas.addEventListener("pointerdown", (event) => {
      const place = event.button === 0 && !event.shiftKey && held === null && this.under(event);
      if (!place) return;
      held = event.pointerId;
      canvas.setPointerCapture(held);
      event.stopImmediatePropagation();
      this.moveTo(place);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (event.pointerId !== held) return;
      event.stopImmediatePropagation();
      const place = this.onFace(event);
      if (place) this.moveTo(place);
    });
    for (const end of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(end, (event) => {
        if (event.pointerId === held) held = null;
      });
    }
  }
  // Where the eye's ray meets the face (x and y, mm), or the plane of its lowest point; or nothing.
  onFace({ clientX, clientY }) {
    const { camera, canvas, heights: [low, high] } = this;
    const [right, up, back] = camera.basis();
    if (back[2] < 0.05) return null;
    const [dx, dy] = [clientX - canvas.clientWidth / 2, canvas.clientHeight / 2 - clientY].map((d) => d * camera.scale());
    const from = along(along(camera.target, dx, right), dy, up);
    const at = (z) => along(from, (z - from[2]) / back[2], back);
    const isAbove = (z) => {
      const [x, y] = at(z);
      return z > this.heightAt(x, y);
    };
    let [last, z] = [high, high];
    for (let i = 1; i <= STEPS && isAbove(z); i++) [last, z] = [z, high - ((high - low) * i) / STEPS];
    for (let i = 0; i < HALVINGS && z < last; i++) {
      const middle = (z + last) / 2;
      if (isAbove(middle)) last = middle;
      else z = middle;
    }
    return at(z).slice(0, 2);
  }
  // The height (mm) of the face at x and y (mm), beyond the region that of its border.
  heightAt(x, y) {
    const { model } = this;
    return model.isFlat ? 0 : MM * model.spot(...this.inRegion(x, y)).height;
  }
  // The nearest place (m) of the region, but for rounding.
  inRegion(x, y) {
    const [a, b] = this.model.reach;
    if (!this.model.is_round) return [between(-a, x / MM, a), between(-b, y / MM, b)];
    const share = Math.min(1, (a * MM) / Math.max(Math.hypot(x, y), 1e-9));
    return [(share * x) / MM, (share * y) / MM];
  }
  // The lowest and the highest point (mm) of the face.
  findHeights() {
    if (this.model.isFlat) return [0, 0];
    const shares = Array.from({ length: 33 }, (_, i) => (i - 16) / 16);
    const [a, b] = this.model.reach;
    const found = shares.flatMap((x) => shares.map((y) => this.heightAt(MM * a * x, MM * b * y)));
    return [Math.min(...found) - 1e-9, Math.max(...found) + 1e-9];
  }
  // The border of the region, a little above the face.
  border() {
    const { model } = this;
    const [a, b] = model.reach;
    return Array.from({ length: BORDER + 1 }, (_, i) => {
      const angle = (2 * Math.PI * i) / BORDER;
      const [c, s] = [Math.cos(angle), Math.sin(angle)];
      const out = model.is_round ? 1 : 1 / Math.max(Math.abs(c), Math.abs(s));
      const [x, y] = [0.9999 * a * c * out, 0.9999 * b * s * out];
      const spot = model.spot(x, y);
      return along([MM * x, MM * y, MM * spot.height], ABOVE * this.size, spot.turn[2]);
    });
  }
  under(event) {
    const place = this.onFace(event);
    if (!place) return null;
    const [a, b] = (this.model.isFlat ? this.model.sides : this.model.reach).map((side) => MM * side);
    const [x, y] = place;
    const isOn = this.model.is_round ? Math.hypot(x, y) <= a : Math.abs(x) <= a && Math.abs(y) <= b;
    return isOn ? place : null;
  }
  moveTo([x, y]) {
    field("x").value = x;
    field("y").value = y;
    this.redraw();
  }
  whole() {
    const [, up] = this.camera.basis();
    const panel = innerWidth < 600 ? 0 : document.getElementById("panel").offsetWidth;
    const wide = (this.canvas.clientWidth - panel) / this.canvas.clientHeight;
    this.camera.look(along(this.told.centre, 0.25 * this.size, up), this.size * Math.max(1.05, 1 / wide));
    this.camera.pan(-panel / 2, 0);
    this.redraw();
  }
  // What is asked, in SI units.
  get query() {
    const value = (name) => field(name).valueAsNumber;
    const { model } = this;
    const [x, y] = [value("x"), value("y")];
    const place = model.body([x / MM, y / MM, this.heightAt(x, y) / MM]).map((part, i) => part + model.origin[i]);
    const turn = value("turn") * DEGREE;
    const [tool, contact] = field("tool").value.split(" ").reverse();
    return {
      tool, ...(contact ? { contact } : {}), at: place, depth: value("depth") / MM, radius: value("radius") / MM,
      angle: value("angle") * DEGREE, length: value("length") / MM, width: value("width") / MM,
      along: model.body([Math.cos(turn), Math.sin(turn), 0]), young: value("young") * 1e3, poisson: value("poisson"),
    };
  }
  redraw() {
    if (!this.asked) requestAnimationFrame(() => this.draw());
    this.asked = true;
  }
  draw() {
    this.asked = false;
    const { query, model } = this;
    for (const [name, tool] of Object.entries(OF_ONE)) field(name).parentElement.hidden = query.tool !== tool;
    field("radius").parentElement.hidden = query.tool === "blade";
    const began = performance.now();
    const touch = model.query(query);
    const isIn = touch.status === "ok";
    const triangles = isIn ? this.surface.press(query, touch, true) : null;
    const took = performance.now() - began;
    this.made.size = 0;
    this.fillBody(triangles, query.depth * MM);
    if (isIn) this.fillArrow(query, touch);
    this.scene.body.fill(this.made);
    this.fillTool(query, isIn);
    this.scene.draw(this.camera, {
      factor: 1, plane: null, epsilon: 0, edges: field("edges").checked, marks: true, tool: true,
    });
    this.tell(query, touch, took);
  }
  fillBody(pressed, deepest) {
    const { made, surface } = this;
    const { rest, moved, n, m } = surface;
    const count = pressed ? pressed.length : 3 * m;
    for (let i = 0; i < count; i++) {
      const v = pressed ? pressed[i] : surface.triangles[(i % 3) * m + Math.floor(i / 3)];
      const first = made.further();
      const { data } = made;
      let square = 0;
      for (let k = 0; k < 3; k++) {
        const shift = pressed ? MM * moved[3 * v + k] : 0;
        data[first + k] = MM * rest[3 * v + k];
        data[first + 3 + k] = shift;
        square += shift * shift;
        data[first + 8 + k] = k === i % 3 ? 1 : 0;
      }
      data[first + 6] = Math.sqrt(square) / deepest;
      data[first + 7] = FREE;
    }
  }
  // The face below the tool, and where its axis meets it (mm).
  get foothold() {
    const [x, y] = [field("x").valueAsNumber, field("y").valueAsNumber];
    return { spot: this.model.spot(...this.inRegion(x, y)), at: [x, y, this.heightAt(x, y)] };
  }
  fillArrow({ depth }, { force, error }) {
    const { spot, at } = this.foothold;
    const local = this.model.axes.map((axis) => inner(axis, force));
    const size = Math.hypot(...local);
    this.largest = Math.max(this.largest, size);
    const length = (ARROW * this.size * size) / this.largest;
    const foot = along(at, -MM * depth, spot.turn[2]);
    arrow(this.made, foot, local.map((value) => value / size), length, error, THICK * this.size);
  }
  fillTool(query, isIn) {
    const made = new Vertices();
    const { spot, at } = this.foothold;
    const down = isIn || query.depth <= 0 ? -MM * query.depth : 0;
    const [radius, length, width] = [query.radius, query.length, query.width].map((size) => MM * size);
    const place = { at, turn: spot.turn, down };
    if (query.tool === "blade") block(made, [length / 2, width / 2], field("turn").valueAsNumber * DEGREE, place);
    else turned(made, profileOf(query.tool, radius, query.angle, spot.bend / MM), place);
    this.scene.gl.uniform3fv(this.scene.at("probe"), rgb(isIn ? this.told.ink.probe : this.told.ink.footprint));
    this.scene.tool.fill(made);
  }
  tell(query, touch, took) {
    for (const { name } of document.querySelectorAll("#panel input[type=range]")) {
      field(name).previousElementSibling.textContent = short(field(name).valueAsNumber);
    }
    const isIn = touch.status === "ok";
    say("status", isIn ? "" : this.told.sentences[touch.status]);
    document.body.dataset.status = touch.status;
    const local = this.model.axes.map((axis) => inner(axis, touch.force));
    const normal = inner(this.foothold.spot.turn[2], local);
    const aside = Math.sqrt(Math.max(inner(local, local) - normal ** 2, 0));
    const bar = document.querySelector("#gauge .bar");
    const whisker = document.querySelector("#gauge .whisker");
    const full = this.largest * 1.1 || 1;
    bar.style.width = isIn ? `${(100 * normal) / full}%` : "0";
    document.querySelector("#doubt .bar").style.width = isIn ? `${Math.min(100, (100 * touch.error) / DOUBT)}%` : "0";
    whisker.hidden = !isIn;
    if (isIn) {
      whisker.style.left = `${(100 * normal * (1 - touch.error)) / full}%`;
      whisker.style.width = `${(200 * normal * touch.error) / full}%`;
    }
    const known = touch.status === "ok" || touch.status === "lost";
    say("reading", isIn ? `F = ${short(normal)} N ± ${short(100 * touch.error, 2)} %` : "");
    say("force", known ? `${short(normal)} N` : "–");
    say("error", isIn ? `± ${short(100 * touch.error, 2)} %` : "");
    say("aside", known ? `${short(1e3 * aside, 2)} mN` : "–");
    say("stiffness", known ? `${short(touch.stiffness)} N/m` : "–");
    say("contact", known ? `${short(MM * touch.radius)} mm` : "–");
    say("took", isIn ? `${took.toFixed(1)} ms` : "–");
  }
}

let page = null;
(async () => {
  const gl = openCanvas();
  if (!gl) return;
  const told = JSON.parse(document.getElementById("told").textContent);
  page = new Page(told, await unpack(document.getElementById("numbers").textContent, told.arrays), gl);
})();
