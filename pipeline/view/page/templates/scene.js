// Drawing: one program for all that is seen.

const VERTEX = `#version 300 es
  layout(location = 0) in vec3 place; layout(location = 1) in vec3 moved;
  layout(location = 2) in vec2 tag; layout(location = 3) in vec3 edge;
  uniform mat3 turn; uniform vec3 target; uniform vec3 scale; uniform float factor;
  centroid out vec3 at; out vec3 seen; out vec2 what; out vec3 far;
  void main() {
    at = place; what = tag; far = edge;
    seen = (place + factor * moved - target) * turn;
    gl_Position = vec4(seen * scale, 1.0);
  }`;
const FRAGMENT = `#version 300 es
  precision highp float;
  centroid in vec3 at; in vec3 seen; in vec2 what; in vec3 far;
  uniform vec4 plane; uniform vec3 stops[32]; uniform int count; uniform float epsilon, pixel;
  uniform bool byName, cut, edges, marks;
  uniform vec3 footprint, held, probe;
  out vec4 result;
  void main() {
    int kind = int(what.y + 0.5);
    if (kind == ${LINE}) { result = vec4(0.55, 0.57, 0.6, 1.0); return; }
    vec3 normal = normalize(cross(dFdx(seen), dFdy(seen)));
    float light = 0.62 + 0.38 * abs(dot(normal, normalize(vec3(-0.35, 0.5, 0.8))));
    if (kind == ${TOOL}) { result = vec4(probe * light, 1.0) * 0.45; return; }
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

// Vertices on the graphics card.
class Part {
  constructor(gl, mode) {
    Object.assign(this, { gl, mode, count: 0, array: gl.createVertexArray(), buffer: gl.createBuffer() });
    gl.bindVertexArray(this.array);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffer);
    [[3, 0], [3, 3], [2, 6], [3, 8]].forEach(([size, first], i) => {
      gl.enableVertexAttribArray(i);
      gl.vertexAttribPointer(i, size, gl.FLOAT, false, 4 * WIDTH, 4 * first);
    });
  }
  fill({ data, size }) {
    this.gl.bindBuffer(this.gl.ARRAY_BUFFER, this.buffer);
    this.gl.bufferData(this.gl.ARRAY_BUFFER, data.subarray(0, size), this.gl.DYNAMIC_DRAW);
    this.count = size / WIDTH;
  }
  draw() {
    this.gl.bindVertexArray(this.array);
    this.gl.drawArrays(this.mode, 0, this.count);
  }
}

const rgb = (hex) => [1, 3, 5].map((i) => Number.parseInt(hex.slice(i, i + 2), 16) / 255);

class Scene {
  constructor(gl, ink) {
    this.gl = gl;
    this.program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(this.program, shader);
    }
    gl.linkProgram(this.program);
    if (!gl.getProgramParameter(this.program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(this.program));
    gl.useProgram(this.program);
    this.places = new Map();
    for (const name of ["body", "section", "tool"]) this[name] = new Part(gl, gl.TRIANGLES);
    this.outline = new Part(gl, gl.LINES);
    for (const [name, hex] of Object.entries(ink)) gl.uniform3fv(this.at(name), rgb(hex));
    gl.enable(gl.DEPTH_TEST);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
  }
  at(uniform) {
    if (!this.places.has(uniform)) this.places.set(uniform, this.gl.getUniformLocation(this.program, uniform));
    return this.places.get(uniform);
  }
  colour({ stops, labels }) {
    const shown = stops.slice(0, 32).map(rgb);
    this.gl.uniform3fv(this.at("stops"), shown.flat());
    this.gl.uniform1i(this.at("count"), shown.length);
    this.gl.uniform1i(this.at("byName"), labels ? 1 : 0);
  }
  // Draw as the camera sees it; `shown` says what: plane (normal and offset, or none), factor, epsilon, edges, …
  draw(camera, shown) {
    const { gl } = this;
    const ratio = window.devicePixelRatio || 1;
    const [width, height] = [gl.canvas.clientWidth, gl.canvas.clientHeight].map((size) => Math.round(size * ratio));
    if (gl.canvas.width !== width || gl.canvas.height !== height) Object.assign(gl.canvas, { width, height });
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.uniformMatrix3fv(this.at("turn"), false, camera.basis().flat());
    gl.uniform3fv(this.at("target"), camera.target);
    gl.uniform3f(this.at("scale"), height / width / camera.half, 1 / camera.half, -1 / camera.depth());
    gl.uniform4f(this.at("plane"), ...(shown.plane || [0, 0, 0, 1]));
    for (const name of ["factor", "epsilon"]) gl.uniform1f(this.at(name), shown[name]);
    for (const name of ["edges", "marks"]) gl.uniform1i(this.at(name), shown[name]);
    gl.uniform1f(this.at("pixel"), ratio);
    gl.uniform1i(this.at("cut"), 0);
    this.body.draw();
    this.outline.draw();
    gl.uniform1i(this.at("cut"), 1);
    if (shown.plane) this.section.draw();
    if (!shown.tool) return;
    gl.enable(gl.BLEND);
    gl.depthMask(false);
    this.tool.draw();
    gl.depthMask(true);
    gl.disable(gl.BLEND);
  }
}

/** What draws on the canvas, or null once the reader is told that there is none. */
function openCanvas() {
  const gl = document.querySelector("canvas").getContext("webgl2", { antialias: true });
  if (!gl) {
    const trouble = document.getElementById("trouble");
    trouble.textContent = "This browser does not draw in three dimensions (WebGL 2), or has it switched off.";
    trouble.hidden = false;
  }
  return gl;
}
