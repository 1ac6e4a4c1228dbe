// Where the eye is, and the hands that move it.

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const along = (a, s, b) => [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]];
const between = (low, value, high) => Math.max(low, Math.min(high, value));

// Parallel projection: `half` is half the height (mm) of what is seen round `target`.
class Camera {
  constructor(canvas, direction, radius, nearest) {
    Object.assign(this, { canvas, radius, nearest, target: [0, 0, 0], half: radius });
    this.azimuth = Math.atan2(direction[1], direction[0]);
    this.elevation = Math.asin(direction[2]);
  }
  // To the right, up, to the eye.
  basis() {
    const [c, s] = [Math.cos(this.azimuth), Math.sin(this.azimuth)];
    const level = Math.cos(this.elevation);
    const back = [level * c, level * s, Math.sin(this.elevation)];
    const right = [-s, c, 0];
    return [right, cross(back, right), back];
  }
  depth() {
    return 4 * this.radius + Math.hypot(...this.target);
  }
  // Millimetres of a pixel.
  scale() {
    return (2 * this.half) / this.canvas.clientHeight;
  }
  look(target, half) {
    Object.assign(this, { target, half });
  }
  pan(dx, dy) {
    const [right, up] = this.basis();
    this.target = along(along(this.target, -dx * this.scale(), right), dy * this.scale(), up);
  }
  turn(dx, dy) {
    this.azimuth -= dx / 150;
    this.elevation = between(-Math.PI / 2, this.elevation + dy / 150, Math.PI / 2);
  }
  // What is under (x, y) stays there.
  zoom(share, x = this.canvas.clientWidth / 2, y = this.canvas.clientHeight / 2) {
    const half = between(this.nearest, this.half * share, 20 * this.radius);
    const rest = 1 - half / this.half;
    this.pan((this.canvas.clientWidth / 2 - x) * rest, (this.canvas.clientHeight / 2 - y) * rest);
    this.half = half;
  }
  // Follow mouse, fingers and keys; `changed` is called after every movement.
  listen(changed) {
    const { canvas } = this;
    const held = new Map();
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
        this.pan(dx / 2, dy / 2);
        this.zoom(apart(from) / apart(to), (to[0] + other[0]) / 2, (to[1] + other[1]) / 2);
      } else if (event.shiftKey || event.buttons & 2) this.pan(dx, dy);
      else this.turn(dx, dy);
      changed();
    });
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    const rolled = (event) => {
      event.preventDefault();
      this.zoom(Math.exp(between(-1, event.deltaY / 400, 1)), event.clientX, event.clientY);
      changed();
    };
    canvas.addEventListener("wheel", rolled, { passive: false });
    canvas.addEventListener("keydown", (event) => {
      const turns = { ArrowLeft: [-15, 0], ArrowRight: [15, 0], ArrowUp: [0, -15], ArrowDown: [0, 15] }[event.key];
      if (turns) this.turn(...turns);
      else if (event.key === "+") this.zoom(0.9);
      else if (event.key === "-") this.zoom(1.1);
      else return;
      event.preventDefault();
      changed();
    });
  }
}
