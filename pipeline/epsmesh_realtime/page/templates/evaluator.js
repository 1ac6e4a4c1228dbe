// The evaluator in C, as WebAssembly: pipeline/epsmesh_realtime/wasm/wasm.c. SI units.

const KINDS_OF_TOOL = { disc: 0, sphere: 1, cone: 2, blade: 3, "bonded disc": 4 };
const CONTACTS = { disc: ["frictionless", "bonded"], blade: ["frictionless"], sphere: ["unilateral"], cone: ["unilateral"] };
const UNKNOWN_TOOL = -1;
const SPOT_NUMBERS = 22;

const inner = (a, b) => a.reduce((sum, value, i) => sum + value * b[i], 0);

async function started(evaluator) {
  try {
    return (await WebAssembly.instantiate(evaluator, { env: Math })).instance;
  } catch (problem) {
    const trouble = document.getElementById("trouble");
    trouble.textContent = `This browser does not run the evaluator (WebAssembly): ${problem.message}`;
    trouble.hidden = false;
    throw problem;
  }
}

// Read the arrays of the page, and start the evaluator with the model; return what else there is to draw.
async function unpackModel(layout) {
  const { evaluator, model, ...drawn } = await unpack(layout);
  const { exports: c } = await started(evaluator);
  const at = c.page_room(model.length);
  new Uint8Array(c.memory.buffer, at, model.length).set(model);
  const status = c.page_load(at, model.length);
  if (status) throw new Error(`the page's model is damaged: ${status}`);
  return { c, ...drawn };
}

class Model {
  // `inputs`: origin, axes (rows x, y, outward), reach, is_round, is_flat, young, poisson.
  constructor(inputs, c) {
    Object.assign(this, inputs, { c });
  }
  // Numbers in the evaluator's memory.
  numbers(at, count) {
    return new Float64Array(this.c.memory.buffer, at, count);
  }
  word(status) {
    const bytes = new Uint8Array(this.c.memory.buffer, this.c.page_word(status));
    return new TextDecoder().decode(bytes.slice(0, bytes.indexOf(0)));
  }
  holds(x, y) {
    const [a, b] = this.reach;
    return this.is_round ? x ** 2 + y ** 2 <= a ** 2 : Math.abs(x) <= a && Math.abs(y) <= b;
  }
  local(at) {
    return this.axes.map((axis) => inner(axis, at.map((value, i) => value - this.origin[i])));
  }
  body(local) {
    return [0, 1, 2].map((i) => local.reduce((sum, value, row) => sum + value * this.axes[row][i], 0));
  }
  // The face at a place: its height, its mean curvature, and its own directions, the normal last.
  spot(x, y) {
    const found = Array.from(this.numbers(this.c.page_spot(x, y), SPOT_NUMBERS));
    return { height: found[0], bend: found[7], turn: [found.slice(13, 16), found.slice(16, 19), found.slice(19)] };
  }
  query({ tool, contact, at, depth, radius = NaN, angle = NaN, length = NaN, width = NaN, along, ...tissue }) {
    const { young = this.young, poisson = this.poisson } = tissue;
    const isKnown = tool in CONTACTS && (contact === undefined || CONTACTS[tool].includes(contact));
    const kind = isKnown ? KINDS_OF_TOOL[contact === "bonded" ? `bonded ${tool}` : tool] : UNKNOWN_TOOL;
    // Without a direction C takes the face's x; a direction without length is none.
    const edge = along === undefined ? [0, 0, 0] : along.some(Boolean) ? along : [NaN, NaN, NaN];
    const status = this.c.page_ask(kind, radius, angle, length, width, ...at, ...edge, depth, young, poisson);
    const [fx, fy, fz, forceError, stiffness, size] = this.numbers(this.c.page_touch(), 6);
    return { status: this.word(status), force: [fx, fy, fz], forceError, stiffness, radius: size };
  }
}
