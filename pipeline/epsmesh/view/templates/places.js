// Surfaces of labels, and places on them: nearest points, distances and normals. Lengths are in mm.

// The normal is the mean over this share of a label's extent, as that of a study's body.
const AROUND = 0.02;

class Surfaces {
  // Points and triangles are stored by coordinate and by corner; `owners` has the label's position of each triangle.
  constructor({ points, triangles, owners }) {
    Object.assign(this, { points, triangles, owners, n: points.length / 3, m: owners.length });
  }
  // The corners of a triangle, as nine numbers.
  corners(t, into) {
    const { points, triangles, n, m } = this;
    for (let j = 0; j < 3; j++) for (let i = 0; i < 3; i++) into[3 * j + i] = points[i * n + triangles[j * m + t]];
    return into;
  }
  // What is drawn of the labels that are shown, and the triangles that it is made of.
  drawn(shown) {
    const made = new Vertices();
    const place = new Float64Array(9);
    this.visible = [];
    for (let t = 0; t < this.m; t++) {
      if (!shown[this.owners[t]]) continue;
      this.visible.push(t);
      this.corners(t, place);
      for (let j = 0; j < 3; j++) {
        const first = made.further();
        for (let i = 0; i < 3; i++) {
          made.data[first + i] = place[3 * j + i];
          made.data[first + 8 + i] = CORNERS[j][i];
        }
        made.data[first + 6] = this.owners[t];
      }
    }
    return made.geometry();
  }
  // For each label the distance to its surface and the nearest point.
  nearest(place, count) {
    const found = Array.from({ length: count }, () => ({ distance: Infinity }));
    const corners = new Float64Array(9);
    for (let t = 0; t < this.m; t++) {
      const own = found[this.owners[t]];
      this.corners(t, corners);
      const [a, b, c] = [corners.subarray(0, 3), corners.subarray(3, 6), corners.subarray(6, 9)];
      // A triangle reaches no further than the longer of two sides.
      if (apart(a, place) - Math.max(apart(a, b), apart(a, c)) >= own.distance) continue;
      const point = nearestOf(place, a, b, c);
      const distance = apart(point, place);
      if (distance < own.distance) Object.assign(own, { distance, point });
    }
    return found;
  }
  // The inward unit normal of a label around a place: the mean, by area.
  inward(place, owner, around) {
    const sum = new THREE.Vector3();
    const corners = new Float64Array(9);
    const [a, b, c, at] = [0, 0, 0, 0].map(() => new THREE.Vector3());
    at.fromArray(place);
    for (let t = 0; t < this.m; t++) {
      if (this.owners[t] !== owner) continue;
      this.corners(t, corners);
      a.fromArray(corners, 0);
      if (a.distanceTo(at) > around) continue;
      b.fromArray(corners, 3).sub(a);
      c.fromArray(corners, 6).sub(a);
      sum.sub(b.cross(c));
    }
    return sum.normalize().toArray();
  }
}

const apart = (p, q) => Math.hypot(p[0] - q[0], p[1] - q[1], p[2] - q[2]);
const dot = (p, q) => p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
const along = (p, q, share) => [0, 1, 2].map((i) => p[i] + share * (q[i] - p[i]));

// The point of a triangle that is nearest to p: in its plane if it is inside there, or else on a side.
function nearestOf(p, a, b, c) {
  const [ab, ac, ap] = [b, c, p].map((q) => [0, 1, 2].map((i) => q[i] - a[i]));
  const [bb, bc, cc, pb, pc] = [dot(ab, ab), dot(ab, ac), dot(ac, ac), dot(ap, ab), dot(ap, ac)];
  const area = bb * cc - bc * bc;
  const [v, w] = [(cc * pb - bc * pc) / area, (bb * pc - bc * pb) / area];
  if (area > 0 && v >= 0 && w >= 0 && v + w <= 1) return [0, 1, 2].map((i) => a[i] + v * ab[i] + w * ac[i]);
  const sides = [[a, b], [b, c], [c, a]].map(([q, r]) => {
    const [qr, qp] = [r, p].map((s) => [0, 1, 2].map((i) => s[i] - q[i]));
    return along(q, r, Math.max(0, Math.min(1, dot(qp, qr) / (dot(qr, qr) || 1))));
  });
  return sides.reduce((best, one) => (apart(one, p) < apart(best, p) ? one : best));
}
