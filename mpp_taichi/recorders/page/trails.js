// Trails: cubics through the recorded places, cut into as many straight pieces as they bend in the picture.

const TRAIL_TOLERANCE = 0.3;  // pixels between a trail and its curve
const MOST_PIECES = 16;  // of a cubic
const BEFORE = 2, AFTER = 3;  // places beside those of an interval that its curve needs
const SAME_BEND = 0.5;  // of the largest second difference: as much it may differ along a path without a collision

/** The places of some particles in six successive rows, as (right, up, depth); row `at` is the one where an interval begins. */
class Window6 {
  constructor(columns, rows, see) {
    Object.assign(this, { columns, rows, see, count: columns.x.entries });
    this.places = Array.from({ length: BEFORE + 1 + AFTER }, () => new Float64Array(3 * this.count));
  }

  read(row, out) {
    const { x, y, z } = this.columns;
    if (row < 0 || row >= this.rows) out.fill(NaN);
    else for (let i = 0; i < this.count; i++) this.see(x.value(row, i), y.value(row, i), z.value(row, i), out, 3 * i);
  }

  begin(row) {
    this.places.forEach((out, n) => this.read(row - BEFORE + n, out));
    this.at = row;
  }

  advance() {
    this.places.push(this.places.shift());
    this.at++;
    this.read(this.at + AFTER, this.places.at(-1));
  }
}

/** Second difference around place n of the window, of the coordinate c. */
const secondDifference = (places, n, c) => places[n + 1][c] - 2 * places[n][c] + places[n - 1][c];

/** Whether a path has no corner in the interval. Where spheres collide, its second difference must stay about the same. */
function isSmooth(places, c, collides) {
  const [, before, begin, end, after] = places;
  let onward = 0, back = 0;
  for (let k = c; k < c + 3; k++) {
    const way = end[k] - begin[k];
    onward += (begin[k] - before[k]) * way;
    back += (after[k] - end[k]) * way;
  }
  if (onward < 0 || back < 0) return false;  // not so where a place is missing
  if (!collides) return true;
  let largest = 0, apart = 0;
  for (let n = 1; n <= 4; n++) {
    let size = 0, change = 0;
    for (let k = c; k < c + 3; k++) {
      const here = secondDifference(places, n, k);
      if (Number.isNaN(here)) return false;
      size += here * here;
      if (n > 1) change += (here - secondDifference(places, n - 1, k)) ** 2;
    }
    largest = Math.max(largest, size);
    apart = Math.max(apart, change);
  }
  return apart <= SAME_BEND ** 2 * largest;
}

/** The way within one interval at the speed of place n: central differences of fourth or second order, at an end one-sided. */
function tangent(places, n, c) {
  const here = places[n][c], one = places[n + 1][c] - places[n - 1][c], two = places[n + 2]?.[c] - places[n - 2]?.[c];
  if (!Number.isNaN(two)) return (8 * one - two) / 12;
  if (!Number.isNaN(one)) return one / 2;
  const side = Number.isNaN(places[n - 1][c]) ? 1 : -1, next = places[n + side][c], far = places[n + 2 * side]?.[c];
  return side * (Number.isNaN(far) || far === undefined ? next - here : 2 * next - 1.5 * here - 0.5 * far);
}

/** Writes the pieces of one interval of one particle. `write(ends, share0, share1)` takes six coordinates and shares of the time. */
class CurveCutter {
  constructor(focal, orthographic, collides) {
    Object.assign(this, { focal, orthographic, collides });
    this.first = [0, 0, 0];
    this.last = [0, 0, 0];
    this.ends = new Float64Array(6);
  }

  cut(places, c, write) {
    const begin = places[BEFORE], end = places[BEFORE + 1], { ends, first, last } = this;
    for (let k = 0; k < 3; k++) [ends[k], ends[3 + k]] = [begin[c + k], end[c + k]];
    const pieces = this.pieces(places, c);
    if (pieces === 1) return void write(ends, 0, 1);
    for (let n = 1; n <= pieces; n++) {
      const t = n / pieces, late = t * t * (3 - 2 * t);
      for (let k = 0; k < 3; k++) {
        ends[3 + k] = (1 - late) * begin[c + k] + late * end[c + k] + t * (1 - t) * ((1 - t) * first[k] - t * last[k]);
      }
      write(ends, (n - 1) / pieces, t);
      ends.copyWithin(0, 3);
    }
  }

  /** How many pieces an interval needs; sets the ways at both ends. */
  pieces(places, c) {
    if (!isSmooth(places, c, this.collides)) return 1;
    const begin = places[BEFORE], end = places[BEFORE + 1], { first, last } = this;
    let one = 0, other = 0;
    for (let k = 0; k < 3; k++) {
      first[k] = tangent(places, BEFORE, c + k);
      last[k] = tangent(places, BEFORE + 1, c + k);
      const way = end[c + k] - begin[c + k];
      one += (6 * way - 4 * first[k] - 2 * last[k]) ** 2;
      other += (4 * last[k] + 2 * first[k] - 6 * way) ** 2;
    }
    const scale = this.orthographic ? this.focal : this.focal / Math.max(Math.min(begin[c + 2], end[c + 2]), 1e-3);
    const wanted = Math.ceil(Math.sqrt(Math.sqrt(Math.max(one, other)) * scale / (8 * TRAIL_TOLERANCE)));
    return Math.min(Math.max(wanted, 1), MOST_PIECES) || 1;
  }
}
