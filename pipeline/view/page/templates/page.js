// The page: what is shown, and its legend.

const field = (name) => document.querySelector(`[name=${name}]`);
const short = (value) => String(Number(value.toPrecision(2)));
const add = (parent, kind, name = "", text = "") => {
  const made = document.createElement(kind);
  made.className = name;
  made.textContent = text;
  parent.append(made);
  return made;
};

class Page {
  constructor(told, mesh, gl) {
    Object.assign(this, { told, mesh, canvas: gl.canvas, asked: false });
    this.scene = new Scene(gl, told.ink);
    this.camera = new Camera(gl.canvas, told.eye, told.radius, 1e-3 * told.tool);
    this.camera.listen(() => this.redraw());
    this.scene.tool.fill(mesh.tool(told.outward.map((o) => 2.5 * told.tool * o)));
    this.scene.outline.fill(linesOf(told.outline));
    this.label();
    field("whole").addEventListener("click", () => this.whole());
    field("close").addEventListener("click", () => this.close());
    field("colour").addEventListener("change", () => this.recolour());
    field("plane").addEventListener("change", () => this.replane());
    field("offset").addEventListener("input", () => this.recut());
    field("deformation").addEventListener("input", () => this.redraw());
    for (const name of ["edges", "ring", "probe", "marks"]) field(name).addEventListener("change", () => this.redraw());
    addEventListener("resize", () => this.redraw());
    this.whole();
    this.replane();
    this.recolour();
  }
  // Name what can be shown, and choose what is first; browsers keep fields over a reload.
  label() {
    const { told, mesh } = this;
    for (const { name } of told.colours) field("colour").append(new Option(name));
    field("colour").selectedIndex = told.colours[0].labels.length > 1 ? 0 : 1;
    field("plane").selectedIndex = 0;
    document.getElementById("deformed").hidden = !mesh.shift;
    field("deformation").value = mesh.shift ? 1 : 0;
    field("ring").parentElement.hidden = !told.epsilon;
    document.querySelector(".ring + span").textContent = `ε = ${short(told.epsilon || 0)} mm`;
    for (const [name, colour] of Object.entries(told.ink)) document.querySelector(`i.${name}`).style.background = colour;
    if (innerWidth < 600) document.getElementById("panel").open = false;
  }

  // ---- from where --------------------------------------------------------------------------------------------
  // Look at `target` so that `half` fits beside the panel, which is closed on a phone.
  look(target, half, width) {
    const panel = innerWidth < 600 ? 0 : document.getElementById("panel").offsetWidth;
    const wide = (this.canvas.clientWidth - panel) / this.canvas.clientHeight;
    this.camera.look(target, Math.max(half, width / wide));
    this.camera.pan(-panel / 2, 0);
    this.redraw();
  }
  whole() {
    const [right, up] = this.camera.basis();
    let [half, width] = [0, 0];
    for (let a = 0; a < this.mesh.n; a++) {
      const offset = along(this.mesh.place(a), -1, this.told.centre);
      half = Math.max(half, Math.abs(dot(offset, up)));
      width = Math.max(width, Math.abs(dot(offset, right)));
    }
    this.look(this.told.centre, 1.2 * half, 1.2 * width);
  }
  close() {
    this.look([0, 0, 0], 3 * this.told.tool, 3 * this.told.tool);
  }

  // ---- what ----------------------------------------------------------------------------------------------------
  get colour() {
    return this.told.colours[field("colour").selectedIndex];
  }
  get plane() {
    const normal = this.told[field("plane").value];
    // What of the surface lies in the plane gives way to the section.
    return normal && [...normal, field("offset").valueAsNumber - 1e-5 * this.told.radius];
  }
  recolour() {
    this.scene.colour(this.colour);
    this.scene.body.fill(this.mesh.surface(this.colour));
    this.describe();
    this.recut();
  }
  // The slider's ends are those of the body; it begins at the contact, or, across the axis, a little within.
  replane() {
    const normal = this.told[field("plane").value];
    if (normal) {
      let [min, max] = [Infinity, -Infinity];
      for (let a = 0; a < this.mesh.n; a++) {
        const height = dot(normal, this.mesh.place(a));
        min = Math.min(min, height);
        max = Math.max(max, height);
      }
      Object.assign(field("offset"), { min, max, value: normal === this.told.outward ? -this.told.tool : 0 });
    }
    this.recut();
  }
  recut() {
    const normal = this.told[field("plane").value];
    const offset = field("offset").valueAsNumber;
    document.getElementById("place").hidden = !normal;
    document.querySelector("#place output").textContent = `${offset.toFixed(2)} mm`;
    if (normal) this.scene.section.fill(this.mesh.section(normal, offset, this.colour));
    this.redraw();
  }
  redraw() {
    if (!this.asked) requestAnimationFrame(() => this.draw());
    this.asked = true;
  }
  draw() {
    this.asked = false;
    const factor = this.told.factor * field("deformation").valueAsNumber;
    document.querySelector("#deformed output").textContent = `× ${short(factor)}`;
    this.scene.draw(this.camera, {
      factor,
      plane: this.plane,
      epsilon: field("ring").checked ? this.told.epsilon || 0 : 0,
      edges: field("edges").checked,
      marks: field("marks").checked,
      tool: field("probe").checked,
    });
    this.sign();
  }

  // ---- legends -------------------------------------------------------------------------------------------------
  describe() {
    const legend = document.getElementById("legend");
    const { labels, stops, limits, unit, array } = this.colour;
    legend.replaceChildren();
    if (labels) {
      const list = add(legend, "ul");
      labels.forEach((label, i) => {
        const line = add(list, "li");
        add(line, "i").style.background = stops[i];
        line.append(` ${label}`);
      });
      return;
    }
    add(legend, "div", "ramp").style.background = `linear-gradient(to right, ${stops})`;
    const [low, high] = limits;
    const middle = array ? Math.sqrt(low * high) : (low + high) / 2;
    const ticks = add(legend, "div", "ticks");
    [low, middle, high].forEach((value, i) => add(ticks, "span", "", short(value) + (i === 2 ? ` ${unit}` : "")));
  }
  // Directions of the axes, and a bar of a length that reads well.
  sign() {
    const [right, up] = this.camera.basis();
    const axes = document.getElementById("axes");
    axes.innerHTML = [0, 1, 2]
      .map((i) => {
        const [x, y] = [28 * right[i], -28 * up[i]];
        return `<line x2="${x}" y2="${y}"/><text x="${1.28 * x}" y="${1.28 * y}">${"xyz"[i]}</text>`;
      })
      .join("");
    const length = 100 * this.camera.scale();
    const power = 10 ** Math.floor(Math.log10(length));
    const round = power * [5, 2, 1].find((step) => step * power <= length);
    const bar = document.getElementById("bar");
    bar.style.width = `${round / this.camera.scale()}px`;
    bar.firstElementChild.textContent = round < 0.1 ? `${short(1000 * round)} µm` : `${short(round)} mm`;
  }
}

(async () => {
  const gl = openCanvas();
  if (!gl) return;
  const told = JSON.parse(document.getElementById("told").textContent);
  const arrays = await unpackMesh(document.getElementById("numbers").textContent, told.arrays);
  new Page(told, new Mesh(arrays, told.shift), gl);
})();
