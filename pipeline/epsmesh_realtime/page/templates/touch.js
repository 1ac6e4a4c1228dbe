// The page: a hand that moves the tool, and what it feels.

const say = (id, text) => {
  document.getElementById(id).textContent = text;
};
const MM = 1e3;
const DEGREE = Math.PI / 180;
// The arrow of the largest force so far is this share of the body's size; arrows are this thick.
const ARROW = 0.35;
const THICK = 0.008;
// What is so far from the face, in units of the body's size, is another side of the body.
const BESIDE = 0.05;
// Points along the border of the region, so far above the face, in units of the body's size.
const BORDER = 200;
const ABOVE = 0.002;
// What is asked for by one tool, or by all but one.
const OF_ONE = { angle: "cone", length: "blade", width: "blade", turn: "blade" };

const between = (low, value, high) => Math.max(low, Math.min(high, value));
// Turn a line of (ρ, z) round the z axis.
const turned = (line) => new THREE.LatheGeometry(line.map((point) => new THREE.Vector2(...point)), 40).rotateX(Math.PI / 2);

// The tool above its lowest point, with a shaft; a disc has the mean curvature of the face.
function geometryOf({ tool, radius, angle, length, width, bend }) {
  const long = 2.5 * radius;
  if (tool === "blade") return new THREE.BoxGeometry(length, width, width).translate(0, 0, 0.51 * width);
  if (tool === "disc") {
    // A little above the face, which it would else fight with for the same pixels.
    const flat = [0, 0.25, 0.5, 0.75, 1].map((share) => [share * radius, (0.02 - 0.5 * bend * radius * share ** 2) * radius]);
    return turned([...flat, [radius, long]]);
  }
  const rise = radius / Math.tan(angle);
  if (tool === "cone") return turned([[0, 0], [radius, rise], [radius, rise + long]]);
  const ball = Array.from({ length: 17 }, (_, i) => (Math.PI * i) / 20);
  const round = ball.map((t) => [radius * Math.sin(t), radius * (1 - Math.cos(t))]);
  return turned([...round, [round.at(-1)[0], round.at(-1)[1] + long]]);
}

// An arrow along z, with a whisker from 1 - error to 1 + error of its length.
function arrow(length, error, thick) {
  const head = length - Math.min(4 * thick, length);
  const cap = (z) => [[2.6, z - 0.25 * thick], [2.6, z + 0.25 * thick]].map(([rho, at]) => [rho * thick, at]);
  const [low, high] = [cap(length * (1 - error)), cap(length * (1 + error))];
  const whisker = [[0, low[0][1]], ...low, [0.4 * thick, low[1][1]], [0.4 * thick, high[0][1]], ...high, [0, high[1][1]]];
  return turned([[thick, 0], [thick, head], [2.2 * thick, head], [0, length], ...whisker]);
}

class Page {
  constructor(inputs, { c, inside, corners }) {
    this.inputs = inputs;
    this.model = new Model(inputs.model, c);
    this.surface = new Surface(this.model);
    this.made = new Vertices();
    this.largest = 0;
    this.size = inputs.radius;
    this.stage = new Stage(inputs, 1e-3 * inputs.radius);
    this.stage.colour({ stops: inputs.stops });
    this.stage.addLines([this.border()]);
    this.arrow = this.stage.addSolid(inputs.ink.footprint);
    this.addInclusions(inside, corners);
    this.unanswered = new Unanswered(this);
    this.listen();
    this.whole();
    this.update();
  }
  // Seen through the surface.
  addInclusions(points, corners) {
    const geometry = new THREE.BufferGeometry().setIndex(new THREE.BufferAttribute(Uint32Array.from(corners), 1));
    const part = this.stage.addSolid(this.inputs.inclusion, 0.35);
    part.material.depthTest = false;
    this.stage.fill(part, geometry.setAttribute("position", new THREE.BufferAttribute(points, 3)));
  }
  listen() {
    for (const { name } of document.querySelectorAll("#panel [name]")) {
      field(name).addEventListener("input", () => this.update());
    }
    field("whole").addEventListener("click", () => this.whole());
    const { canvas } = this.stage;
    let held = null;
    // Before the camera's own: what begins on the face moves the tool.
    const listen = (kind, heard) => canvas.addEventListener(kind, heard, { capture: true });
    listen("pointerdown", (event) => {
      const place = event.button === 0 && !event.shiftKey && held === null && this.onFace(event);
      if (!place) return;
      held = event.pointerId;
      canvas.setPointerCapture(held);
      event.stopImmediatePropagation();
      this.moveTo(place);
    });
    listen("pointermove", (event) => {
      if (event.pointerId !== held) return;
      event.stopImmediatePropagation();
      const place = this.onFace(event);
      if (place) this.moveTo(place);
    });
    const end = (event) => {
      if (event.pointerId === held) held = null;
    };
    listen("pointerup", end);
    listen("pointercancel", end);
  }

  // ---- places ----------------------------------------------------------------------------------------------------
  // Where the eye's ray meets the face (x and y, mm), if it does.
  onFace(event) {
    const hit = this.stage.under(event, this.stage.body)?.point;
    if (!hit || Math.abs(hit.z - this.heightAt(hit.x, hit.y)) > BESIDE * this.size) return null;
    return this.model.is_flat || this.model.holds(hit.x / MM, hit.y / MM) ? [hit.x, hit.y] : null;
  }
  // The height (mm) of the face at x and y (mm), beyond the region that of its border.
  heightAt(x, y) {
    return this.model.is_flat ? 0 : MM * this.model.spot(...this.inRegion(x, y)).height;
  }
  // The nearest place (m) of the region, but for rounding.
  inRegion(x, y) {
    const [a, b] = this.model.reach;
    if (!this.model.is_round) return [between(-a, x / MM, a), between(-b, y / MM, b)];
    const share = Math.min(1, (a * MM) / Math.max(Math.hypot(x, y), 1e-9));
    return [(share * x) / MM, (share * y) / MM];
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
      const { height, turn: [, , normal] } = model.spot(x, y);
      return vector([x, y, height]).multiplyScalar(MM).addScaledVector(vector(normal), ABOVE * this.size).toArray();
    });
  }
  // The face below the tool, and where its axis meets it (mm).
  get foothold() {
    const [x, y] = [field("x").valueAsNumber, field("y").valueAsNumber];
    return { spot: this.model.spot(...this.inRegion(x, y)), at: [x, y, this.heightAt(x, y)] };
  }
  moveTo([x, y]) {
    field("x").value = x;
    field("y").value = y;
    this.update();
  }
  whole() {
    this.stage.follow(() => {
      const centre = vector(this.inputs.centre).addScaledVector(this.stage.basis()[1], 0.1 * this.size);
      return [centre, 0.9 * this.size, this.size];
    });
  }

  // ---- what is asked, and what is shown --------------------------------------------------------------------------
  // In SI units.
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
  // Evaluate once before the next picture.
  update() {
    this.stage.beforeDrawing = () => {
      this.stage.beforeDrawing = () => {};
      this.show();
    };
    this.stage.redraw();
  }
  show() {
    const { query, stage } = this;
    for (const [name, tool] of Object.entries(OF_ONE)) field(name).parentElement.hidden = query.tool !== tool;
    field("radius").parentElement.hidden = query.tool === "blade";
    const began = performance.now();
    const touch = this.model.query(query);
    const isIn = touch.status === "ok";
    const triangles = isIn ? this.surface.press(query, touch, true) : null;
    const took = performance.now() - began;
    this.fillBody(triangles, query.depth * MM);
    describe({ stops: this.inputs.stops, limits: [0, Math.max(query.depth * MM, 0)], unit: "mm", linear: true });
    stage.fill(stage.body, this.made.geometry());
    stage.uniforms.edges.value = field("edges").checked;
    this.arrow.visible = isIn;
    if (isIn) this.point(query, touch);
    this.place(query, isIn);
    this.tell(query, touch, took);
    this.tellUnanswered(this.unanswered.update(query));
  }
  // Why parts of the face are shaded.
  tellUnanswered(shares) {
    const list = document.getElementById("unanswered");
    const reasons = Object.keys(shares).filter((status) => status !== "ok");
    list.replaceChildren(...reasons.map((status) => {
      const item = document.createElement("li");
      item.className = status === "outside" ? "outside" : "other";
      item.textContent = `${Math.round(100 * shares[status])} % of the face, ${status}: ${this.inputs.sentences[status]}`;
      return item;
    }));
  }
  fillBody(pressed, deepest) {
    const { made, surface } = this;
    const { rest, moved, m } = surface;
    made.size = 0;
    const count = pressed ? pressed.length : 3 * m;
    for (let i = 0; i < count; i++) {
      const v = pressed ? pressed[i] : surface.triangles[i];
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
      data[first + 7] = 0;
    }
  }
  // Draw the force, from the tool's tip.
  point({ depth }, { force, forceError }) {
    const { spot, at } = this.foothold;
    const local = vector(this.model.axes.map((axis) => inner(axis, force)));
    this.largest = Math.max(this.largest, local.length());
    const length = (ARROW * this.size * local.length()) / this.largest;
    this.stage.fill(this.arrow, arrow(length, forceError / local.length(), THICK * this.size));
    this.arrow.position.copy(vector(at)).addScaledVector(vector(spot.turn[2]), -MM * depth);
    this.arrow.quaternion.setFromUnitVectors(vector([0, 0, 1]), local.normalize());
  }
  // Put the tool on the face, or in it; red where there is no answer.
  place(query, isIn) {
    const { tool } = this.stage;
    const { spot, at } = this.foothold;
    const [radius, length, width] = [query.radius, query.length, query.width].map((size) => MM * size);
    const shape = { tool: query.tool, radius, angle: query.angle, length, width, bend: spot.bend / MM };
    if (JSON.stringify(shape) !== this.shape) this.stage.fill(tool, geometryOf(shape));
    this.shape = JSON.stringify(shape);
    const axes = new THREE.Matrix4().makeBasis(...spot.turn.map(vector));
    tool.quaternion.setFromRotationMatrix(axes);
    if (query.tool === "blade") tool.rotateZ(field("turn").valueAsNumber * DEGREE);
    const down = isIn || query.depth <= 0 ? -MM * query.depth : 0;
    tool.position.copy(vector(at)).addScaledVector(vector(spot.turn[2]), down);
    tool.material.uniforms.colour.value = rgb(isIn ? this.inputs.ink.probe : this.inputs.ink.footprint);
  }
  tell(query, touch, took) {
    for (const { name } of document.querySelectorAll("#panel input[type=range]")) {
      field(name).previousElementSibling.textContent = short(field(name).valueAsNumber);
    }
    const isIn = touch.status === "ok";
    say("status", isIn ? "" : this.inputs.sentences[touch.status]);
    document.body.dataset.status = touch.status;
    const local = this.model.axes.map((axis) => inner(axis, touch.force));
    const normal = inner(this.foothold.spot.turn[2], local);
    const share = touch.forceError / normal;
    const aside = Math.sqrt(Math.max(inner(local, local) - normal ** 2, 0));
    const bar = document.querySelector("#gauge .bar");
    const whisker = document.querySelector("#gauge .whisker");
    const full = this.largest * 1.1 || 1;
    bar.style.width = isIn ? `${(100 * normal) / full}%` : "0";
    whisker.hidden = !isIn;
    if (isIn) {
      whisker.style.left = `${(100 * normal * (1 - share)) / full}%`;
      whisker.style.width = `${(200 * normal * share) / full}%`;
    }
    const known = touch.status === "ok" || touch.status === "no contact";
    // One unit for what is compared.
    const [factor, unit] = Math.abs(normal) < 1 ? [1e3, "mN"] : [1, "N"];
    say("reading", isIn ? `F = ${short(factor * normal)} ${unit} ± ${short(100 * share, 2)} %` : "");
    say("force", known ? `${short(factor * normal)} ${unit}` : "–");
    say("error", isIn ? `± ${short(100 * share, 2)} %` : "");
    say("aside", known ? `${short(factor * aside, 2)} ${unit}` : "–");
    say("stiffness", known ? `${short(touch.stiffness)} N/m` : "–");
    say("contact", known ? `${short(MM * touch.radius)} mm` : "–");
    say("took", isIn ? `${took.toFixed(1)} ms` : "–");
  }
}

start(Page, unpackModel);
