// The page of a label map: labels that are shown, slices, and a place with what a study needs of it.

// By the axis that is fixed: names, the axes across, which decreases to the right as radiologists look, and up.
const SLICES = [
  { name: "sagittal", across: 1, up: 2, ends: "front | back" },
  { name: "coronal", across: 0, up: 2, ends: "right | left" },
  { name: "axial", across: 0, up: 1, ends: "right | left" },
];
const STILL = 4; // pixels that a click may move
const round1 = (value) => (Math.round(10 * value) / 10 || 0).toFixed(1);

class Page {
  constructor(inputs, { voxels, ...surfaces }) {
    Object.assign(this, { inputs, voxels });
    this.surfaces = new Surfaces(surfaces);
    this.shown = inputs.segments.map(() => true);
    this.chosen = inputs.segments.reduce((best, one, i, all) => (one.volume > all[best].volume ? i : best), 0);
    this.stage = new Stage(inputs, 1e-3 * inputs.radius);
    this.stage.uniforms.edges.value = false;
    this.stage.colour({ stops: inputs.segments.map((one) => one.colour), labels: true });
    this.marker = this.stage.addSolid(inputs.ink.footprint);
    this.rgb = inputs.segments.map((one) => rgb(one.colour).map((part) => Math.round(255 * part)));
    this.list();
    this.makeSlices();
    this.listen();
    this.toVoxels = new THREE.Matrix4().set(...inputs.inverse.flat(), 0, 0, 0, 1);
    this.toPatient = this.toVoxels.clone().invert();
    this.voxel = inputs.shape.map((n) => (n - 1) / 2);
    this.redraw();
    this.choose(this.chosen);
    this.drawSlices();
    this.stage.whole(inputs);
  }
  list() {
    const list = document.getElementById("segments");
    this.lines = this.inputs.segments.map((one, i) => {
      const line = add(list, "li");
      const box = add(line, "input");
      Object.assign(box, { type: "checkbox", checked: true, title: `show ${one.title}`, ariaLabel: `show ${one.title}` });
      box.addEventListener("input", () => this.show((k) => (k === i ? box.checked : this.shown[k])));
      add(line, "i").style.background = one.colour;
      add(line, "button", "", one.title).addEventListener("click", () => this.choose(i));
      add(line, "span", "", `${short(one.volume, 4)} cm³`);
      return { line, box };
    });
  }
  listen() {
    field("all").addEventListener("click", () => this.show(() => true));
    field("none").addEventListener("click", () => this.show(() => false));
    field("whole").addEventListener("click", () => this.stage.whole(inputs));
    const { canvas } = this.stage;
    let start = null;
    canvas.addEventListener("pointerdown", (event) => {
      start = event.isPrimary ? event : null;
    });
    canvas.addEventListener("pointerup", (event) => {
      const isClick = start && Math.hypot(event.clientX - start.clientX, event.clientY - start.clientY) < STILL;
      start = null;
      if (isClick) this.click(event);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (event.buttons) return;
      if (!this.moved) requestAnimationFrame(() => this.hover());
      this.moved = event;
    });
  }
  // The place under the pointer, from the centre, and its label.
  pick(event) {
    const hit = this.stage.under(event, this.stage.body);
    return hit && { place: hit.point.toArray(), owner: this.surfaces.owners[this.surfaces.visible[Math.floor(hit.faceIndex)]] };
  }
  hover() {
    const found = this.pick(this.moved);
    this.moved = null;
    document.getElementById("under").textContent = found
      ? `${this.inputs.segments[found.owner].title}: ${this.patient(found.place).map(round1).join(", ")} mm`
      : "Click on a surface or in a slice to choose a place.";
  }
  click(event) {
    const found = this.pick(event);
    if (found) this.take(found.place, found.owner);
  }
  // In the patient's frame, mm.
  patient(place) {
    return place.map((part, i) => part + this.inputs.centre[i]);
  }
  show(of) {
    this.shown = this.shown.map((_, i) => of(i));
    this.lines.forEach(({ box }, i) => {
      box.checked = this.shown[i];
    });
    this.redraw();
  }
  redraw() {
    this.stage.fill(this.stage.body, this.surfaces.drawn(this.shown));
  }
  choose(i) {
    this.chosen = i;
    const one = this.inputs.segments[i];
    this.lines.forEach(({ line }, k) => line.classList.toggle("chosen", k === i));
    const [low, high] = one.box;
    const notes = [
      `# ${short(one.volume, 4)} cm³, ${one.extent.map((e) => short(e)).join(" × ")} mm${one.pieces > 1 ? `, ${one.pieces} pieces` : ""}`,
      ...["x", "y", "z"].map((axis, k) => `# ${axis} from ${round1(low[k])} to ${round1(high[k])} mm`),
      ...(one.cut ? ["# reaches the image's end"] : []),
    ];
    document.getElementById("body").textContent = [...notes, one.block].join("\n");
  }

  // ---- a place ---------------------------------------------------------------------------------------------------
  // Choose a place (mm from the centre), of a label's surface or within the image.
  take(place, owner) {
    const { segments } = this.inputs;
    const patient = this.patient(place);
    this.voxel = vector(patient).applyMatrix4(this.toVoxels).toArray();
    const near = this.surfaces.nearest(place, segments.length);
    const own = owner ?? (this.labelAt(this.voxel) || this.chosen + 1) - 1;
    const on = owner === undefined ? near[own].point : place;
    const extent = Math.max(...segments[own].extent);
    const inward = this.surfaces.inward(on, own, Math.max(AROUND * extent, 1.5 * Math.max(...this.inputs.spacing)));
    if (own !== this.chosen) this.choose(own);
    this.mark(on, inward);
    const list = document.getElementById("place");
    list.replaceChildren();
    list.hidden = false;
    const row = (name, value) => {
      add(list, "dt", "", name);
      add(list, "dd", "", value);
    };
    row("place, mm", patient.map(round1).join(", "));
    row(`inward normal of ${segments[own].title}`, inward.map((part) => (Math.round(1000 * part) / 1000 || 0).toFixed(3)).join(", "));
    const others = near.map(({ distance }, i) => [distance, i]).filter(([, i]) => i !== own || owner === undefined);
    for (const [distance, i] of others.sort(([p], [q]) => p - q).slice(0, 8)) row(`to ${segments[i].title}`, `${round1(distance)} mm`);
    const at = document.getElementById("at");
    at.hidden = false;
    at.textContent = `at = [${this.patient(on).map((part) => `"${round1(part)} mm"`).join(", ")}]`;
    this.drawSlices();
  }
  // The position of a voxel's label, from 1; 0 is background.
  labelAt(voxel) {
    const { shape } = this.inputs;
    const [i, j, k] = voxel.map((part, axis) => Math.max(0, Math.min(shape[axis] - 1, Math.round(part))));
    return this.voxels[(i * shape[1] + j) * shape[2] + k];
  }
  // An arrow from outside to the place, and a ball there.
  mark(place, inward) {
    const size = 0.045 * this.inputs.radius;
    const line = [[0, 0], [0.35, 0.6], [0.5, 1.4], [0.16, 1.4], [0.16, 6], [0, 6]].map(([rho, z]) => new THREE.Vector2(rho * size, z * size));
    const outward = vector(inward).negate();
    const across = vector(Math.abs(inward[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0]).cross(outward).normalize();
    const turn = new THREE.Matrix4().makeBasis(across, outward, across.clone().cross(outward));
    const geometry = new THREE.LatheGeometry(line, 24).applyMatrix4(turn).translate(...place);
    this.stage.fill(this.marker, geometry);
  }

  // ---- slices ----------------------------------------------------------------------------------------------------
  makeSlices() {
    const { shape, spacing } = this.inputs;
    this.panes = SLICES.map((slice, axis) => {
      const figure = add(document.getElementById("slices"), "figure");
      const canvas = add(figure, "canvas");
      const [width, height] = [shape[slice.across], shape[slice.up]];
      Object.assign(canvas, { width, height, ariaLabel: `${slice.name} slice: click to choose a place`, role: "img" });
      canvas.style.aspectRatio = `${width * spacing[slice.across]} / ${height * spacing[slice.up]}`;
      canvas.addEventListener("click", (event) => this.clickSlice(event, canvas, slice));
      const caption = add(figure, "figcaption");
      return { ...slice, axis, canvas, caption };
    });
  }
  clickSlice(event, canvas, { across, up }) {
    const { left, top, width, height } = canvas.getBoundingClientRect();
    const voxel = [...this.voxel];
    voxel[across] = (1 - (event.clientX - left) / width) * canvas.width - 0.5;
    voxel[up] = (1 - (event.clientY - top) / height) * canvas.height - 0.5;
    this.take(vector(voxel).applyMatrix4(this.toPatient).sub(vector(this.inputs.centre)).toArray());
  }
  drawSlices() {
    const { shape } = this.inputs;
    const at = this.voxel.map((part, i) => Math.max(0, Math.min(shape[i] - 1, Math.round(part))));
    const steps = [shape[1] * shape[2], shape[2], 1];
    for (const { name, axis, across, up, ends, canvas, caption } of this.panes) {
      const [columns, rows] = [canvas.width, canvas.height];
      const context = canvas.getContext("2d");
      const image = context.createImageData(columns, rows);
      for (let row = 0; row < rows; row++) {
        for (let column = 0; column < columns; column++) {
          const [i, j] = [columns - 1 - column, rows - 1 - row];
          const value = this.voxels[at[axis] * steps[axis] + i * steps[across] + j * steps[up]];
          const isCross = i === at[across] || j === at[up];
          const colour = value ? this.rgb[value - 1] : [12, 14, 17];
          const first = 4 * (row * columns + column);
          for (let k = 0; k < 3; k++) image.data[first + k] = isCross ? Math.round(0.55 * colour[k] + 0.45 * 255) : colour[k];
          image.data[first + 3] = 255;
        }
      }
      context.putImageData(image, 0, 0);
      const height = vector(at).applyMatrix4(this.toPatient).toArray()[axis];
      caption.textContent = `${name}, ${"xyz"[axis]} = ${Math.round(height)} mm`;
      add(caption, "div", "", ends);
    }
  }
}

start(Page);
