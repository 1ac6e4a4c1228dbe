"use strict";
// What the pages share: three.js, vertices, and a stage with camera, axes and a bar of scale. Lengths are in mm.

const KINDS = { f4: Float32Array, i4: Int32Array, i2: Int16Array, u1: Uint8Array };
const textOf = (id) => document.getElementById(id).textContent;
const field = (name) => document.querySelector(`[name=${name}]`);
// A length in mm, in the unit in which it is read.
const length = (mm) => (Math.abs(mm) < 0.1 && mm ? `${short(1000 * mm)} µm` : `${short(mm)} mm`);
const short = (value, digits = 3) => String(Number(value.toPrecision(digits)));

async function inflate(id) {
  const bytes = Uint8Array.from(atob(textOf(id)), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Response(stream).arrayBuffer();
}

// Return the arrays of a page by name: first bytes of all numbers, then second ones.
async function unpack(layout) {
  const raw = new Uint8Array(await inflate("numbers"));
  const found = {};
  let start = 0;
  for (const [name, kind, count] of layout) {
    const made = new KINDS[kind](count);
    const into = new Uint8Array(made.buffer);
    const width = made.BYTES_PER_ELEMENT;
    for (let b = 0; b < width; b++) for (let i = 0; i < count; i++) into[i * width + b] = raw[start + b * count + i];
    start += width * count;
    found[name] = made;
  }
  return found;
}

// Vertices that grow: place, displacement, value, group of the boundary, distances to the three edges.
const ATTRIBUTES = [["position", 3, 0], ["moved", 3, 3], ["value", 1, 6], ["group", 1, 7], ["edge", 3, 8]];
const WIDTH = 11;
const CORNERS = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];

class Vertices {
  constructor() {
    this.data = new Float32Array(WIDTH * 3000);
    this.size = 0;
  }
  // Return where the numbers of a further vertex begin.
  further() {
    if (this.size === this.data.length) {
      const larger = new Float32Array(2 * this.data.length);
      larger.set(this.data);
      this.data = larger;
    }
    this.size += WIDTH;
    return this.size - WIDTH;
  }
  // What is drawn of them, in buffers that last until there are more vertices than they hold.
  geometry() {
    if (this.buffer?.array !== this.data) {
      this.buffer = new THREE.InterleavedBuffer(this.data, WIDTH);
      this.made = new THREE.BufferGeometry();
      for (const [name, size, first] of ATTRIBUTES) {
        this.made.setAttribute(name, new THREE.InterleavedBufferAttribute(this.buffer, size, first));
      }
    }
    this.buffer.clearUpdateRanges();
    this.buffer.addUpdateRange(0, this.size);
    this.buffer.needsUpdate = true;
    this.made.setDrawRange(0, this.size / WIDTH);
    this.made.boundingSphere = null;
    return this.made;
  }
}

const VERTEX = `
  in vec3 moved, edge; in float value, group;
  uniform float factor;
  centroid out vec3 at; out vec3 seen, far; out float amount, where;
  void main() {
    at = position; far = edge; amount = value; where = group;
    seen = (modelViewMatrix * vec4(position + factor * moved, 1.0)).xyz;
    gl_Position = projectionMatrix * vec4(seen, 1.0);
  }`;
const LIGHT = `
  precision highp float;
  in vec3 seen; out vec4 result;
  float light() {
    vec3 normal = normalize(cross(dFdx(seen), dFdy(seen)));
    return 0.62 + 0.38 * abs(dot(normal, normalize(vec3(-0.35, 0.5, 0.8))));
  }`;
// Premultiplied: the library blends so.
const SOLID = `${LIGHT}
  uniform vec3 colour; uniform float opacity;
  void main() { result = vec4(colour * light(), 1.0) * opacity; }`;
const TISSUE = `${LIGHT}
  centroid in vec3 at; in vec3 far; in float amount, where;
  uniform vec4 plane; uniform vec3 stops[32]; uniform int count; uniform float epsilon, pixel;
  uniform bool byName, cut, edges, marks;
  uniform vec3 footprint, held;
  void main() {
    if (!cut && dot(plane.xyz, at) >= plane.w) discard;
    float x = clamp(amount, 0.0, 1.0) * float(count - 1);
    int below = min(int(x), count - 2);
    vec3 colour = byName ? stops[int(amount + 0.5) % 32] : mix(stops[below], stops[below + 1], x - float(below));
    if (!cut) colour *= light();
    int kind = int(where + 0.5);
    if (marks && kind == 1) colour = mix(colour, footprint, 0.7);
    if (marks && kind == 2) {
      float stripe = abs(fract((gl_FragCoord.x + gl_FragCoord.y) / (9.0 * pixel)) - 0.5);
      colour = mix(colour, held, 0.75 * smoothstep(0.36, 0.42, stripe));
    }
    if (edges) {
      vec3 step = fwidth(far);
      vec3 near = smoothstep(vec3(0.0), max(1.2 * pixel * step, 1e-6), far);
      // Elements of a few pixels would be nothing but edges.
      float crowded = max(step.x, max(step.y, step.z)) * pixel;
      float ink = (cut ? 0.7 : 0.5) * (1.0 - 0.8 * smoothstep(0.08, 0.4, crowded));
      colour = mix(colour, vec3(0.07), ink * (1.0 - min(near.x, min(near.y, near.z))));
    }
    if (epsilon > 0.0) {
      float r = length(at);
      colour = mix(vec3(0.05), colour, smoothstep(1.2, 2.0, abs(r - epsilon) / (fwidth(r) * pixel)));
    }
    result = vec4(colour, 1.0);
  }`;

const rgb = (hex) => [1, 3, 5].map((i) => Number.parseInt(hex.slice(i, i + 2), 16) / 255);
const vector = (place) => new THREE.Vector3(...place);

// Body, section of the body, tool and lines; a parallel projection, turned by mouse, fingers and keys.
class Stage {
  constructor({ eye, radius, ink }, nearest) {
    const canvas = document.querySelector("canvas");
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true });
    this.renderer.sortObjects = false; // that would measure every part for each picture
    this.scene = new THREE.Scene();
    this.camera = new THREE.OrthographicCamera();
    this.camera.up.set(0, 0, 1);
    this.camera.position.copy(vector(eye));
    this.controls = new THREE.OrbitControls(this.camera, canvas);
    Object.assign(this.controls, { zoomToCursor: true, minZoom: 0.05, maxZoom: radius / nearest });
    Object.assign(this, { canvas, radius, ink, beforeDrawing: () => {} });
    this.uniforms = {
      factor: { value: 1 }, plane: { value: [0, 0, 0, 1] }, stops: { value: [] }, count: { value: 0 },
      byName: { value: false }, epsilon: { value: 0 }, pixel: { value: 1 }, edges: { value: true },
      marks: { value: true }, footprint: { value: rgb(ink.footprint) }, held: { value: rgb(ink.held) },
    };
    this.body = this.add(this.material(TISSUE, { ...this.uniforms, cut: { value: false } }));
    this.section = this.add(this.material(TISSUE, { ...this.uniforms, cut: { value: true } }));
    this.tool = this.addSolid(ink.probe, 0.45);
    this.controls.addEventListener("start", () => this.follow(null));
    this.controls.addEventListener("change", () => this.redraw());
    canvas.addEventListener("keydown", (event) => this.press(event));
    // A page in a frame may have no size when its script runs.
    new ResizeObserver(() => this.resize()).observe(canvas);
  }
  material(fragmentShader, uniforms, more) {
    const { GLSL3, DoubleSide } = THREE;
    return new THREE.ShaderMaterial({
      glslVersion: GLSL3, side: DoubleSide, vertexShader: VERTEX, fragmentShader, uniforms, ...more,
    });
  }
  add(material) {
    const made = new THREE.Mesh(new THREE.BufferGeometry(), material);
    made.frustumCulled = false;
    this.scene.add(made);
    return made;
  }
  // A part of one colour, with a factor of its own.
  addSolid(hex, opacity = 1) {
    const uniforms = { factor: { value: 1 }, colour: { value: rgb(hex) }, opacity: { value: opacity } };
    const isGlass = opacity < 1;
    return this.add(this.material(SOLID, uniforms, { transparent: isGlass, depthWrite: !isGlass, premultipliedAlpha: true }));
  }
  addLines(polylines) {
    const ends = polylines.flatMap((line) => line.slice(1).flatMap((place, i) => [line[i], place]));
    const geometry = new THREE.BufferGeometry().setFromPoints(ends.map(vector));
    this.scene.add(new THREE.LineSegments(geometry, new THREE.LineBasicMaterial({ color: this.ink.outline })));
  }
  fill(part, geometry) {
    if (part.geometry !== geometry) part.geometry.dispose();
    part.geometry = geometry;
    this.redraw();
  }
  colour({ stops, labels }) {
    const shown = stops.slice(0, 32).map(rgb);
    const { uniforms } = this;
    [uniforms.stops.value, uniforms.count.value, uniforms.byName.value] = [shown.flat(), shown.length, Boolean(labels)];
  }

  // ---- from where ----------------------------------------------------------------------------------------------
  // Show what `find` returns, beside the panel and below the header, and again whenever the page has another size: a place, and half the
  // height and width that are to fit. Until somebody moves the camera.
  follow(find) {
    this.find = find;
    this.resize();
  }
  // All corners of a box.
  whole({ low, high }) {
    const centre = vector(low).add(vector(high)).multiplyScalar(0.5);
    const half = vector(high).sub(centre).toArray();
    this.follow(() => {
      const reach = (along) => 1.1 * half.reduce((sum, side, i) => sum + side * Math.abs(along.getComponent(i)), 0);
      const [right, up] = this.basis();
      return [centre, reach(up), reach(right)];
    });
  }
  resize() {
    const { canvas: { clientWidth: width, clientHeight: height }, camera, controls, radius } = this;
    if (!width || !height) return;
    const details = document.getElementById("panel");
    if (!this.isSized && width < 600) details.open = false;
    this.isSized = true;
    this.renderer.setPixelRatio(devicePixelRatio);
    this.renderer.setSize(width, height, false);
    Object.assign(camera, { top: radius, bottom: -radius, right: (radius * width) / height, left: (-radius * width) / height });
    Object.assign(camera, { near: 0, far: 100 * radius });
    const panel = width < 600 ? 0 : details.offsetWidth;
    const { bottom } = document.querySelector("header").getBoundingClientRect();
    const head = Math.min(bottom, height / 2); // texts of a narrow screen may be higher than it
    camera.setViewOffset(width, height, panel / 2, -head / 2, width, height);
    if (this.find) {
      const [target, half, wide] = this.find();
      const back = camera.position.clone().sub(controls.target).setLength(50 * radius);
      controls.target.copy(target);
      camera.position.copy(target).add(back);
      camera.zoom = (radius / height) * Math.min((height - head) / half, (width - panel) / wide);
    }
    camera.updateProjectionMatrix();
    controls.update();
    this.redraw();
  }
  // The camera's directions: to the right, up, to the eye.
  basis() {
    const directions = [0, 1, 2].map(() => new THREE.Vector3());
    this.camera.updateMatrixWorld(); // which is a picture old
    this.camera.matrixWorld.extractBasis(...directions);
    return directions;
  }
  // Millimetres of a pixel.
  scale() {
    return (2 * this.radius) / this.camera.zoom / this.canvas.clientHeight;
  }
  // What of a part is seen at the pointer, where it was before it moved: its nearest point, and the triangle.
  under({ clientX, clientY }, part) {
    const { clientWidth, clientHeight } = this.canvas;
    const ray = new THREE.Raycaster();
    ray.setFromCamera(new THREE.Vector2((2 * clientX) / clientWidth - 1, 1 - (2 * clientY) / clientHeight), this.camera);
    return ray.intersectObject(part)[0];
  }
  press(event) {
    const { controls } = this;
    const turns = { ArrowLeft: [0.1, 0], ArrowRight: [-0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] }[event.key];
    if (!turns && !["+", "-"].includes(event.key)) return;
    event.preventDefault();
    this.find = null;
    if (turns) {
      controls.rotateLeft(turns[0]);
      controls.rotateUp(turns[1]);
    } else if (event.key === "+") controls.dollyIn(0.9);
    else controls.dollyOut(0.9);
  }

  // ---- drawing -------------------------------------------------------------------------------------------------
  redraw() {
    if (!this.asked) requestAnimationFrame(() => this.draw());
    this.asked = true;
  }
  draw() {
    this.asked = false;
    if (!this.canvas.clientHeight) return;
    this.uniforms.pixel.value = devicePixelRatio;
    this.beforeDrawing();
    this.renderer.render(this.scene, this.camera);
    this.sign();
  }
  // Directions of the axes, and a bar of a length that reads well.
  sign() {
    const [right, up] = this.basis().map((direction) => direction.toArray());
    document.getElementById("axes").innerHTML = [0, 1, 2]
      .map((i) => {
        const [x, y] = [28 * right[i], -28 * up[i]];
        return `<line x2="${x}" y2="${y}"/><text x="${1.28 * x}" y="${1.28 * y}">${"xyz"[i]}</text>`;
      })
      .join("");
    const longest = 100 * this.scale();
    const power = 10 ** Math.floor(Math.log10(longest));
    const round = power * [5, 2, 1].find((step) => step * power <= longest);
    const bar = document.getElementById("bar");
    bar.style.width = `${round / this.scale()}px`;
    bar.firstElementChild.textContent = length(round);
  }
}

const add = (parent, kind, name = "", text = "") => {
  const made = document.createElement(kind);
  made.className = name;
  made.textContent = text;
  parent.append(made);
  return made;
};

// Show what colours mean: names, or a scale with its unit, logarithmic or `linear`.
function describe({ labels, stops, limits, unit, linear }) {
  const legend = document.getElementById("legend");
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
  const middle = linear ? (low + high) / 2 : Math.sqrt(low * high);
  const ticks = add(legend, "div", "ticks");
  [low, middle, high].forEach((value, i) => add(ticks, "span", "", short(value, 2) + (i === 2 ? ` ${unit}` : "")));
}

let page = null;
// Put the library into the page, then make `Page` of what the page holds; `prepare` reads its arrays.
async function start(Page, prepare = unpack) {
  const library = document.createElement("script");
  library.textContent = new TextDecoder().decode(await inflate("library"));
  document.head.append(library);
  const inputs = JSON.parse(textOf("inputs"));
  const arrays = await prepare(inputs.arrays);
  if (document.createElement("canvas").getContext("webgl2")) page = new Page(inputs, arrays);
  else {
    const trouble = document.getElementById("trouble");
    trouble.textContent = "This browser does not draw in three dimensions (WebGL 2), or has it switched off.";
    trouble.hidden = false;
  }
}
