"use strict";
// A body that is turned, zoomed and cut open. Lengths are in mm, places relative to the contact.
(async () => {
  const told = JSON.parse(document.getElementById("told").textContent);
  const canvas = document.querySelector("canvas");
  const field = (name) => document.querySelector(`[name=${name}]`);
  const fail = (why) => {
    document.getElementById("trouble").textContent = why;
    document.getElementById("trouble").hidden = false;
  };
  const gl = canvas.getContext("webgl2", { antialias: true });
  if (!gl) return fail("This browser does not draw in three dimensions (WebGL 2), or has it switched off.");

  // ---- numbers: planes of bytes, differences -----------------------------------------------------------
  const kinds = { f4: Float32Array, i4: Int32Array, i2: Int16Array, u1: Uint8Array };
  async function unpack() {
    const coded = atob(document.getElementById("numbers").textContent);
    const bytes = new Uint8Array(coded.length);
    for (let i = 0; i < coded.length; i++) bytes[i] = coded.charCodeAt(i);
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    const raw = new Uint8Array(await new Response(stream).arrayBuffer());
    const found = {};
    let start = 0;
    for (const [name, kind, count] of told.arrays) {
      const made = new kinds[kind](count);
      const into = new Uint8Array(made.buffer);
      const width = made.BYTES_PER_ELEMENT;
      for (let b = 0; b < width; b++) for (let i = 0; i < count; i++) into[i * width + b] = raw[start + b * count + i];
      start += width * count;
      found[name] = made;
    }
    const { cells, faces } = found;
    const m = cells.length / 4;
    for (let i = 1; i < m; i++) cells[i] += cells[i - 1];
    for (let i = m; i < 4 * m; i++) cells[i] += cells[i - m];
    for (let i = 1; i < faces.length; i++) faces[i] += faces[i - 1];
    return found;
  }
  const { points, cells, faces, groups, shift, ...values } = await unpack();
  const n = points.length / 3;
  const m = cells.length / 4;
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const along = (a, s, b) => [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]];

  // ---- triangles: place, displacement, value and kind, distances to the three edges -----------------------
  const WIDTH = 11;
  const PROBE = 4;
  const LINE = 5;
  let colour = told.colours[0];
  class Triangles {
    constructor() {
      this.data = new Float32Array(WIDTH * 3000);
      this.size = 0;
    }
    // A vertex on the edge from point a to point b, at the share t.
    put(a, b, t, value, kind, edge, lifted = [0, 0, 0]) {
      if (this.size + WIDTH > this.data.length) {
        const larger = new Float32Array(2 * this.data.length);
        larger.set(this.data);
        this.data = larger;
      }
      const d = this.data;
      let k = this.size;
      let moved = 0;
      for (let i = 0; i < 3; i++) {
        const p = points[i * n + a];
        d[k + i] = p + t * (points[i * n + b] - p) + lifted[i];
        const s = shift ? told.shift * (shift[i * n + a] + t * (shift[i * n + b] - shift[i * n + a])) : 0;
        d[k + 3 + i] = s;
        moved += s * s;
      }
      // Where no cell's value is given, it is the length of the displacement.
      d[k + 6] = value < 0 ? Math.sqrt(moved) / largest : value;
      d[k + 7] = kind;
      d.set(edge, k + 8);
      this.size = k + WIDTH;
    }
  }
  const largest = (() => {
    let found = 0;
    if (shift) for (let i = 0; i < n; i++) found = Math.max(found, Math.hypot(shift[i], shift[n + i], shift[2 * n + i]));
    return told.shift * found;
  })();
  const valueOf = (cell) => {
    if (!colour.array) return -1;
    return colour.labels ? values[colour.array][cell] : values[colour.array][cell] / 255;
  };
  const CORNERS = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
  // Of a quadrangle's two halves: the third edge is none of the polygon's.
  const HALVES = [[[1, 1, 0], [0, 1, 0], [0, 1, 1]], [[1, 1, 0], [0, 1, 0], [0, 1, 1]]];

  function cornersOf(face) {
    const cell = face >> 2;
    return [0, 1, 2, 3].filter((j) => j !== (face & 3)).map((j) => cells[j * m + cell]);
  }
  function surface() {
    const made = new Triangles();
    faces.forEach((face, i) => {
      const value = valueOf(face >> 2);
      cornersOf(face).forEach((a, j) => made.put(a, a, 0, value, groups[i], CORNERS[j]));
    });
    return made;
  }
  // The polygons in which the plane cuts cells. A point in the plane counts as before it: a plane of the mesh is cut
  // into the faces of the cells behind it, which stay.
  function section(normal, offset) {
    const made = new Triangles();
    const height = new Float32Array(n);
    for (let i = 0; i < n; i++) {
      height[i] = normal[0] * points[i] + normal[1] * points[n + i] + normal[2] * points[2 * n + i] - offset;
    }
    const before = [0, 0, 0, 0];
    const behind = [0, 0, 0, 0];
    for (let cell = 0; cell < m; cell++) {
      let k = 0;
      let l = 0;
      for (let j = 0; j < 4; j++) {
        const a = cells[j * m + cell];
        if (height[a] >= 0) before[k++] = a;
        else behind[l++] = a;
      }
      if (!k || !l) continue;
      const value = valueOf(cell);
      const put = (a, b, edge) => made.put(a, b, height[a] / (height[a] - height[b]), value, 0, edge);
      const [a, b, c] = before;
      const [d, e, f] = behind;
      if (k === 1) [d, e, f].forEach((other, j) => put(a, other, CORNERS[j]));
      else if (l === 1) [a, b, c].forEach((other, j) => put(other, d, CORNERS[j]));
      else {
        const round = [[a, d], [a, e], [b, e], [b, d]];
        [[0, 1, 2], [2, 3, 0]].forEach((half, h) => half.forEach((j, i) => put(...round[j], HALVES[h][i])));
      }
    }
    return made;
  }
  // The tool: its footprint, drawn out of the tissue.
  function tool() {
    const made = new Triangles();
    const lifted = told.outward.map((o) => o * 2.5 * told.tool);
    const seen = new Map();
    faces.forEach((face, i) => {
      if (groups[i] !== 1) return;
      const triangle = cornersOf(face);
      for (const lift of [[0, 0, 0], lifted]) triangle.forEach((a, j) => made.put(a, a, 0, 0, PROBE, CORNERS[j], lift));
      for (const [a, b] of [[0, 1], [1, 2], [0, 2]].map(([i, j]) => [triangle[i], triangle[j]])) {
        const key = Math.min(a, b) * n + Math.max(a, b);
        if (seen.has(key)) seen.delete(key);
        else seen.set(key, [a, b]);
      }
    });
    for (const [a, b] of seen.values()) {
      for (const corners of [[[a], [b], [b, 1]], [[b, 1], [a, 1], [a]]]) {
        corners.forEach(([p, up], j) => made.put(p, p, 0, 0, PROBE, CORNERS[j], up ? lifted : [0, 0, 0]));
      }
    }
    return made;
  }
  function outline() {
    const made = new Triangles();
    const put = (p) => {
      made.put(0, 0, 0, 0, LINE, [1, 1, 1]);
      made.data.set([...p, 0, 0, 0], made.size - WIDTH);
    };
    for (const line of told.outline) for (let i = 1; i < line.length; i++) [line[i - 1], line[i]].forEach(put);
    return made;
  }

  // ---- drawing ---------------------------------------------------------------------------------------------
  const VERTEX = `#version 300 es
    layout(location = 0) in vec3 place; layout(location = 1) in vec3 moved;
    layout(location = 2) in vec2 tag; layout(location = 3) in vec3 edge;
    uniform mat3 turn; uniform vec3 target; uniform vec3 scale; uniform float factor;
    out vec3 at; out vec3 seen; out vec2 what; out vec3 far;
    void main() {
      at = place; what = tag; far = edge;
      seen = (place + factor * moved - target) * turn;
      gl_Position = vec4(seen * scale, 1.0);
    }`;
  const FRAGMENT = `#version 300 es
    precision highp float;
    in vec3 at; in vec3 seen; in vec2 what; in vec3 far;
    uniform vec4 plane; uniform vec3 stops[32]; uniform int count; uniform float epsilon, pixel;
    uniform bool byName, cut, edges, marks;
    uniform vec3 footprint, held, probe;
    out vec4 result;
    void main() {
      int kind = int(what.y + 0.5);
      if (kind == ${LINE}) { result = vec4(0.55, 0.57, 0.6, 1.0); return; }
      vec3 normal = normalize(cross(dFdx(seen), dFdy(seen)));
      float light = 0.62 + 0.38 * abs(dot(normal, normalize(vec3(-0.35, 0.5, 0.8))));
      if (kind == ${PROBE}) { result = vec4(probe * light, 1.0) * 0.45; return; }
      if (!cut && dot(plane.xyz, at) >= plane.w) discard;
      float x = clamp(what.x, 0.0, 1.0) * float(count - 1);
      int below = min(int(x), count - 2);
      vec3 colour = byName ? stops[int(what.x + 0.5) % 32] : mix(stops[below], stops[below + 1], x - float(below));
      if (!cut) colour *= light;
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
  function compile() {
    const program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    gl.useProgram(program);
    return program;
  }
  const program = compile();
  const at = new Map();
  const uniform = (name) => at.get(name) ?? at.set(name, gl.getUniformLocation(program, name)).get(name);
  class Part {
    constructor(mode) {
      this.mode = mode;
      this.count = 0;
      this.array = gl.createVertexArray();
      this.buffer = gl.createBuffer();
      gl.bindVertexArray(this.array);
      gl.bindBuffer(gl.ARRAY_BUFFER, this.buffer);
      [[3, 0], [3, 3], [2, 6], [3, 8]].forEach(([size, first], i) => {
        gl.enableVertexAttribArray(i);
        gl.vertexAttribPointer(i, size, gl.FLOAT, false, 4 * WIDTH, 4 * first);
      });
    }
    fill(made) {
      gl.bindBuffer(gl.ARRAY_BUFFER, this.buffer);
      gl.bufferData(gl.ARRAY_BUFFER, made.data.subarray(0, made.size), gl.DYNAMIC_DRAW);
      this.count = made.size / WIDTH;
    }
    draw() {
      gl.bindVertexArray(this.array);
      gl.drawArrays(this.mode, 0, this.count);
    }
  }
  const parts = { body: new Part(gl.TRIANGLES), cut: new Part(gl.TRIANGLES), tool: new Part(gl.TRIANGLES), lines: new Part(gl.LINES) };
  const rgb = (hex) => [1, 3, 5].map((i) => Number.parseInt(hex.slice(i, i + 2), 16) / 255);
  for (const [name, hex] of Object.entries(told.ink)) gl.uniform3fv(uniform(name), rgb(hex));
  gl.enable(gl.DEPTH_TEST);
  gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);

  // ---- where the eye is ------------------------------------------------------------------------------------
  const eye = { azimuth: Math.atan2(told.eye[1], told.eye[0]), height: Math.asin(told.eye[2]), target: told.centre, half: 1 };
  // Room beside the panel, in widths of the window's height; on a phone that is closed.
  const beside = () => (innerWidth < 600 ? 0 : document.getElementById("panel").offsetWidth);
  const wide = () => (canvas.clientWidth - beside()) / canvas.clientHeight;
  function look(target, half) {
    Object.assign(eye, { target, half });
    pan(-beside() / 2, 0);
  }
  const close = () => look([0, 0, 0], (3 * told.tool) / Math.min(wide(), 1));
  // As large as fits.
  function whole() {
    const [right, up] = basis();
    let half = 0;
    for (let i = 0; i < n; i++) {
      const offset = along([points[i], points[n + i], points[2 * n + i]], -1, told.centre);
      half = Math.max(half, Math.abs(dot(offset, up)), Math.abs(dot(offset, right)) / wide());
    }
    look(told.centre, 1.2 * half);
  }
  function basis() {
    const [c, s, u, v] = [Math.cos(eye.azimuth), Math.sin(eye.azimuth), Math.cos(eye.height), Math.sin(eye.height)];
    const back = [u * c, u * s, v];
    const right = [-s, c, 0];
    return [right, cross(back, right), back];
  }
  let asked = false;
  function draw() {
    asked = false;
    const ratio = window.devicePixelRatio || 1;
    const [width, height] = [Math.round(canvas.clientWidth * ratio), Math.round(canvas.clientHeight * ratio)];
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const rows = basis();
    gl.uniformMatrix3fv(uniform("turn"), false, rows.flat());
    gl.uniform3fv(uniform("target"), eye.target);
    const deep = 1 / (4 * told.radius + Math.hypot(...eye.target));
    gl.uniform3f(uniform("scale"), height / width / eye.half, 1 / eye.half, -deep);
    gl.uniform1f(uniform("factor"), told.factor * field("deformation").valueAsNumber);
    gl.uniform1f(uniform("pixel"), ratio);
    const ring = told.epsilon && field("ring").checked;
    gl.uniform1f(uniform("epsilon"), ring ? told.epsilon : 0);
    gl.uniform1i(uniform("edges"), field("edges").checked);
    gl.uniform1i(uniform("marks"), field("marks").checked);
    const plane = field("plane").value;
    gl.uniform4f(uniform("plane"), ...(plane ? told[plane] : [0, 0, 0]), plane ? field("offset").valueAsNumber - 1e-5 * told.radius : 1);
    gl.uniform1i(uniform("cut"), 0);
    parts.body.draw();
    parts.lines.draw();
    gl.uniform1i(uniform("cut"), 1);
    if (plane) parts.cut.draw();
    if (field("probe").checked) {
      gl.enable(gl.BLEND);
      gl.depthMask(false);
      parts.tool.draw();
      gl.depthMask(true);
      gl.disable(gl.BLEND);
    }
    sign(rows);
  }
  const redraw = () => {
    if (!asked) requestAnimationFrame(draw);
    asked = true;
  };
  // Axes and the bar of a length that reads well.
  function sign(rows) {
    document.getElementById("axes").innerHTML = ["x", "y", "z"]
      .map((name, i) => {
        const [x, y] = [28 * rows[0][i], -28 * rows[1][i]];
        return `<line x2="${x.toFixed(1)}" y2="${y.toFixed(1)}"/><text x="${(1.28 * x).toFixed(1)}" y="${(1.28 * y).toFixed(1)}">${name}</text>`;
      })
      .join("");
    const length = (100 * 2 * eye.half) / canvas.clientHeight;
    const power = 10 ** Math.floor(Math.log10(length));
    const round = power * [5, 2, 1].find((step) => step * power <= length);
    const bar = document.getElementById("bar");
    bar.style.width = `${(round / (2 * eye.half)) * canvas.clientHeight}px`;
    bar.firstElementChild.textContent = round < 0.1 ? `${short(1000 * round)} µm` : `${short(round)} mm`;
  }
  const short = (value) => String(Number(value.toPrecision(2)));

  // ---- what is shown ---------------------------------------------------------------------------------------
  function recolour() {
    colour = told.colours[field("colour").selectedIndex];
    const stops = colour.stops.slice(0, 32).map(rgb);
    gl.uniform3fv(uniform("stops"), stops.flat());
    gl.uniform1i(uniform("count"), stops.length);
    gl.uniform1i(uniform("byName"), colour.labels ? 1 : 0);
    parts.body.fill(surface());
    describe();
    recut();
  }
  function describe() {
    const legend = document.getElementById("legend");
    legend.replaceChildren();
    const add = (parent, kind, name = "", text = "") => {
      const made = document.createElement(kind);
      made.className = name;
      made.textContent = text;
      parent.append(made);
      return made;
    };
    if (colour.labels) {
      const list = add(legend, "ul");
      colour.labels.forEach((label, i) => {
        const line = add(list, "li");
        add(line, "i").style.background = colour.stops[i % colour.stops.length];
        line.append(` ${label}`);
      });
      return;
    }
    add(legend, "div", "ramp").style.background = `linear-gradient(to right, ${colour.stops})`;
    const [low, high] = colour.limits;
    const middle = colour.array ? Math.sqrt(low * high) : (low + high) / 2;
    const ticks = add(legend, "div", "ticks");
    [low, middle, high].forEach((value, i) => add(ticks, "span", "", short(value) + (i === 2 ? ` ${colour.unit}` : "")));
  }
  function recut() {
    const plane = field("plane").value;
    document.getElementById("place").hidden = !plane;
    if (plane) parts.cut.fill(section(told[plane], field("offset").valueAsNumber));
    document.querySelector("#place output").textContent = `${field("offset").valueAsNumber.toFixed(2)} mm`;
    redraw();
  }
  // The slider's ends are those of the body; it begins at the contact, or, across the axis, a little within.
  function replane() {
    const normal = told[field("plane").value];
    if (normal) {
      let [low, high] = [Infinity, -Infinity];
      for (let i = 0; i < n; i++) {
        const height = dot(normal, [points[i], points[n + i], points[2 * n + i]]);
        low = Math.min(low, height);
        high = Math.max(high, height);
      }
      Object.assign(field("offset"), { min: low, max: high, value: normal === told.outward ? -told.tool : 0 });
    }
    recut();
  }
  function redeform() {
    const factor = told.factor * field("deformation").valueAsNumber;
    document.querySelector("#deformed output").textContent = `× ${short(factor)}`;
    redraw();
  }

  // ---- hands -----------------------------------------------------------------------------------------------
  const held = new Map();
  const millimetres = () => (2 * eye.half) / canvas.clientHeight;
  function pan(dx, dy) {
    const [right, up] = basis();
    eye.target = along(along(eye.target, -dx * millimetres(), right), dy * millimetres(), up);
  }
  function turn(dx, dy) {
    eye.azimuth -= dx / 150;
    eye.height = Math.max(-1.5707, Math.min(1.5707, eye.height + dy / 150));
  }
  // What is under (x, y) stays there.
  function zoom(share, x = canvas.clientWidth / 2, y = canvas.clientHeight / 2) {
    const half = Math.max(1e-3 * told.tool, Math.min(20 * told.radius, eye.half * share));
    const [dx, dy] = [x - canvas.clientWidth / 2, y - canvas.clientHeight / 2];
    pan(-dx * (1 - half / eye.half), -dy * (1 - half / eye.half));
    eye.half = half;
  }
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    held.set(event.pointerId, [event.clientX, event.clientY]);
  });
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (event) => held.delete(event.pointerId));
  canvas.addEventListener("pointermove", (event) => {
    const from = held.get(event.pointerId);
    if (!from) return;
    const to = [event.clientX, event.clientY];
    const [dx, dy] = [to[0] - from[0], to[1] - from[1]];
    held.set(event.pointerId, to);
    if (held.size === 2) {
      const [other] = [...held].filter(([id]) => id !== event.pointerId).map(([, place]) => place);
      const apart = (place) => Math.hypot(place[0] - other[0], place[1] - other[1]) || 1;
      pan(dx / 2, dy / 2);
      zoom(apart(from) / apart(to), (to[0] + other[0]) / 2, (to[1] + other[1]) / 2);
    } else if (event.shiftKey || event.buttons & 2) pan(dx, dy);
    else turn(dx, dy);
    redraw();
  });
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    zoom(Math.exp(Math.max(-1, Math.min(1, event.deltaY / 400))), event.clientX, event.clientY);
    redraw();
  }, { passive: false });
  canvas.addEventListener("keydown", (event) => {
    const turns = { ArrowLeft: [-15, 0], ArrowRight: [15, 0], ArrowUp: [0, -15], ArrowDown: [0, 15] }[event.key];
    if (turns) turn(...turns);
    else if (event.key === "+") zoom(0.9);
    else if (event.key === "-") zoom(1.1);
    else return;
    event.preventDefault();
    redraw();
  });
  field("whole").addEventListener("click", () => redraw(whole()));
  field("close").addEventListener("click", () => redraw(close()));
  field("colour").addEventListener("change", recolour);
  field("plane").addEventListener("change", replane);
  field("offset").addEventListener("input", recut);
  field("deformation").addEventListener("input", redeform);
  for (const name of ["edges", "ring", "probe", "marks"]) field(name).addEventListener("change", redraw);
  addEventListener("resize", redraw);

  // ---- begin -----------------------------------------------------------------------------------------------
  for (const { name } of told.colours) field("colour").append(new Option(name));
  const regions = told.colours[0].labels.length;
  field("colour").selectedIndex = regions > 1 ? 0 : 1;
  document.getElementById("deformed").hidden = !shift;
  field("deformation").value = shift ? 1 : 0;
  field("ring").parentElement.hidden = !told.epsilon;
  document.querySelector(".ring + span").textContent = `ε = ${short(told.epsilon || 0)} mm`;
  for (const name of ["footprint", "held", "probe"]) document.querySelector(`i.${name}`).style.background = told.ink[name];
  if (innerWidth < 600) document.getElementById("panel").open = false;
  parts.tool.fill(tool());
  parts.lines.fill(outline());
  whole();
  redeform();
  field("plane").selectedIndex = 0;
  recolour();
  replane();
})();
