// The page of a case: what is shown, and its legend.

class Page {
  constructor(inputs, { tool_points, tool_moved, tool_triangles, ...arrays }) {
    this.inputs = inputs;
    this.mesh = new Mesh(arrays, inputs.shift, inputs.largest);
    this.stage = new Stage(inputs, 1e-3 * inputs.tool);
    this.stage.beforeDrawing = () => this.prepare();
    this.stage.addLines(inputs.outline);
    const tool = new THREE.BufferGeometry().setIndex(new THREE.BufferAttribute(Uint32Array.from(tool_triangles), 1));
    tool.setAttribute("position", new THREE.BufferAttribute(tool_points, 3));
    this.stage.fill(this.stage.tool, tool.setAttribute("moved", new THREE.BufferAttribute(tool_moved, 3)));
    this.label();
    field("whole").addEventListener("click", () => this.stage.whole(inputs));
    field("close").addEventListener("click", () => this.close());
    field("colour").addEventListener("change", () => this.recolour());
    field("plane").addEventListener("change", () => this.replane());
    field("offset").addEventListener("input", () => this.recut());
    for (const name of ["deformation", "edges", "ring", "probe", "marks"]) {
      field(name).addEventListener("input", () => this.stage.redraw());
    }
    this.stage.whole(inputs);
    this.replane();
    this.recolour();
  }
  // Name what can be shown, and choose what is first; browsers keep fields over a reload.
  label() {
    const { inputs } = this;
    for (const { name } of inputs.colours) field("colour").append(new Option(name));
    field("colour").selectedIndex = inputs.colours[0].labels.length > 1 ? 0 : 1;
    field("plane").selectedIndex = 0;
    document.getElementById("deformed").hidden = !inputs.factor;
    Object.assign(field("deformation"), { max: inputs.factor, value: inputs.start });
    field("ring").parentElement.hidden = !inputs.epsilon;
    const words = { ring: `ε = ${length(inputs.epsilon || 0)}`, probe: inputs.touching, held: inputs.held };
    words.footprint = inputs.touching === "jaws" ? "below the jaws" : "below the tool";
    for (const [name, text] of Object.entries(words)) document.querySelector(`.${name} + span`).textContent = text;
    document.querySelector("i.held").hidden = !inputs.held;
    field("probe").parentElement.hidden = !inputs.touching;
    for (const name of ["footprint", "held", "probe"]) document.querySelector(`i.${name}`).style.background = inputs.ink[name];
  }
  close() {
    const half = 3 * this.inputs.tool;
    this.stage.follow(() => [vector([0, 0, 0]), half, half]);
  }
  get colour() {
    return this.inputs.colours[field("colour").selectedIndex];
  }
  get normal() {
    return this.inputs[field("plane").value];
  }
  recolour() {
    this.stage.colour(this.colour);
    this.stage.fill(this.stage.body, this.mesh.surface(this.colour).geometry());
    describe(this.colour);
    this.recut();
  }
  // The slider's ends are those of the body; it begins at the contact, or, across the axis, a little within.
  replane() {
    if (this.normal) {
      const heights = this.mesh.heights(this.normal);
      const [min, max] = ["min", "max"].map((end) => heights.reduce((a, b) => Math[end](a, b)));
      Object.assign(field("offset"), { min, max, value: this.normal === this.inputs.outward ? -this.inputs.tool : 0 });
    }
    this.recut();
  }
  recut() {
    const { normal, stage } = this;
    const offset = field("offset").valueAsNumber;
    document.getElementById("place").hidden = !normal;
    document.querySelector("#place output").textContent = length(offset);
    stage.section.visible = Boolean(normal);
    // What of the surface lies in the plane gives way to the section.
    stage.uniforms.plane.value = normal ? [...normal, offset - 1e-5 * this.inputs.radius] : [0, 0, 0, 1];
    if (normal) stage.fill(stage.section, this.mesh.section(normal, offset, this.colour).geometry());
    stage.redraw();
  }
  prepare() {
    const { uniforms, tool } = this.stage;
    const factor = field("deformation").valueAsNumber;
    document.querySelector("#deformed output").textContent = `× ${short(factor)}`;
    uniforms.factor.value = factor;
    // A tool that is not flat is drawn where it is: its shape is not drawn larger, either.
    tool.material.uniforms.factor.value = this.inputs.keeps_depth ? Math.min(factor, 1) : factor;
    tool.visible = field("probe").checked;
    uniforms.epsilon.value = (field("ring").checked && this.inputs.epsilon) || 0;
    uniforms.edges.value = field("edges").checked;
    // Marks are on the faces that pressures colour.
    uniforms.marks.value = field("marks").checked && !this.colour.faces;
  }
}

start(Page, unpackMesh);
