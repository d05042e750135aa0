// A plot of curves against time, with ticks at round numbers and a cursor.

const MARGINS = { left: 62, right: 12, top: 10, bottom: 30 };
const FEW_SAMPLES = 60;  // which are marked one by one
const GAP = 10;  // between values at the cursor
const TICKS = { across: 5, up: 4 };

/** Round numbers, 1, 2 or 5 times a power of ten apart, about `count` of them between low and high. */
function ticks(low, high, count) {
  const rough = (high - low) / count, power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].find((factor) => factor * power >= 0.7 * rough) * power, found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push(k * step);
  return { step, values: found };
}

/** A number with so many digits, without needless zeros, in a spelling that people read. */
function spelled(value, digits = 4) {
  if (!Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e6 || size < 1e-3) return value.toExponential(digits - 1).replace(/\.?0+e/, "e").replace("e+", "e").replace("-", "−").replace("e-", "e−");
  return String(Number(value.toPrecision(Math.max(digits, Math.ceil(Math.log10(size) + 1e-9))))).replace("-", "−");
}

/** Labels of ticks: as many digits as tell them apart. */
function labels({ step, values }) {
  const largest = Math.max(...values.map(Math.abs), step);
  const digits = Math.max(1, Math.ceil(Math.log10(largest / step) + 1e-9) + 1);
  return values.map((value) => (Math.abs(value) < 1e-9 * step ? "0" : spelled(value, Math.min(digits, 9))));
}

/** Curves [{ label, unit, times, values }] against time; values may be missing (not finite), and so may the unit. */
class Plot {
  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.still = document.createElement("canvas");  // all but the cursor
    this.curves = [];
  }

  show(curves, timeLabel) {
    this.curves = curves;
    this.timeLabel = timeLabel;
    this.layOut();
  }

  /** Find the ranges and draw all that stays as it is while time goes on. */
  layOut() {
    const ratio = window.devicePixelRatio || 1, { clientWidth: width, clientHeight: height } = this.canvas;
    for (const canvas of [this.canvas, this.still]) Object.assign(canvas, { width: width * ratio, height: height * ratio });
    Object.assign(this, { width, height, ratio });
    const style = getComputedStyle(this.canvas);
    this.colors = Object.fromEntries(["ink", "quiet", "line", "grid"].map((name) => [name, style.getPropertyValue(`--${name}`)]));
    this.palette = [0, 1, 2].map((k) => style.getPropertyValue(`--curve-${k}`));
    this.findRanges();
    const pen = this.still.getContext("2d");
    pen.scale(ratio, ratio);
    pen.font = "11px system-ui, sans-serif";
    this.drawAxes(pen);
    this.curves.forEach((curve, k) => this.drawCurve(pen, curve, this.palette[k % this.palette.length]));
  }

  findRanges() {
    const times = this.curves.flatMap(({ times: all }) => [all[0], all[all.length - 1]]);
    this.time = times.length ? [Math.min(...times), Math.max(...times)] : [0, 1];
    let low = Infinity, high = -Infinity;
    for (const { values } of this.curves) {
      for (const value of values) {
        if (!Number.isFinite(value)) continue;
        low = Math.min(low, value);
        high = Math.max(high, value);
      }
    }
    if (low > high) [low, high] = [0, 1];
    // What rounding alone tells apart is one and the same.
    const least = 1e-12 * Math.max(Math.abs(low), Math.abs(high)) || 1;
    const room = high - low > least ? 0.06 * (high - low) : Math.max(0.5 * Math.abs(low), least);
    this.range = [low - room, high + room];
    // Digits of a value at the cursor: a thousandth of the range is told.
    this.digits = Math.min(3 + Math.max(1, Math.ceil(Math.log10(Math.max(Math.abs(low), Math.abs(high)) / (2 * room)))), 12) || 4;
  }

  left(time) {
    const [first, last] = this.time, inside = this.width - MARGINS.left - MARGINS.right;
    return MARGINS.left + inside * (last > first ? (time - first) / (last - first) : 0.5);
  }

  top(value) {
    const [low, high] = this.range;
    return this.height - MARGINS.bottom - (this.height - MARGINS.top - MARGINS.bottom) * (value - low) / (high - low);
  }

  drawAxes(pen) {
    const across = ticks(...(this.time[1] > this.time[0] ? this.time : [this.time[0], this.time[0] + 1]), TICKS.across);
    const up = ticks(...this.range, TICKS.up), floor = this.height - MARGINS.bottom, wall = this.width - MARGINS.right;
    pen.lineWidth = 1;
    pen.strokeStyle = this.colors.grid;
    pen.fillStyle = this.colors.quiet;
    const rule = (x0, y0, x1, y1) => { pen.beginPath(); pen.moveTo(x0, y0); pen.lineTo(x1, y1); pen.stroke(); };
    pen.textAlign = "right";
    pen.textBaseline = "middle";
    labels(up).forEach((text, k) => {
      const y = Math.round(this.top(up.values[k])) + 0.5;
      rule(MARGINS.left, y, wall, y);
      pen.fillText(text, MARGINS.left - 5, y);
    });
    pen.textBaseline = "top";
    pen.fillText(this.timeLabel, wall, floor + 5);
    const free = wall - pen.measureText(this.timeLabel).width - 6;  // left of what the axis is called
    pen.textAlign = "center";
    labels(across).forEach((text, k) => {
      const x = Math.round(this.left(across.values[k])) + 0.5;
      rule(x, MARGINS.top, x, floor);
      if (x + pen.measureText(text).width / 2 <= free) pen.fillText(text, x, floor + 5);
    });
    pen.strokeStyle = this.colors.line;
    pen.strokeRect(MARGINS.left + 0.5, MARGINS.top + 0.5, wall - MARGINS.left - 1, floor - MARGINS.top);
  }

  drawCurve(pen, { times, values }, color) {
    pen.save();
    pen.beginPath();
    pen.rect(MARGINS.left, MARGINS.top, this.width - MARGINS.left - MARGINS.right, this.height - MARGINS.top - MARGINS.bottom);
    pen.clip();
    pen.strokeStyle = color;
    pen.lineWidth = 1.6;
    pen.lineJoin = "round";
    pen.beginPath();
    let broken = true;
    times.forEach((time, k) => {
      const gap = !Number.isFinite(values[k]);
      if (!gap) pen[broken ? "moveTo" : "lineTo"](this.left(time), this.top(values[k]));
      broken = gap;
    });
    pen.stroke();
    pen.fillStyle = color;
    if (times.length <= FEW_SAMPLES) times.forEach((time, k) => pen.fillRect(this.left(time) - 1.5, this.top(values[k]) - 1.5, 3, 3));
    pen.restore();
  }

  /** The curves with a cursor at a time, and what they are there. */
  draw(time) {
    const pen = this.context, x = Math.round(this.left(time)) + 0.5;
    pen.setTransform(1, 0, 0, 1, 0, 0);
    pen.clearRect(0, 0, this.canvas.width, this.canvas.height);
    pen.drawImage(this.still, 0, 0);
    pen.scale(this.ratio, this.ratio);
    pen.strokeStyle = this.colors.quiet;
    pen.lineWidth = 1;
    pen.beginPath();
    pen.moveTo(x, MARGINS.top);
    pen.lineTo(x, this.height - MARGINS.bottom);
    pen.stroke();
    const values = this.curves.map((curve) => interpolated(curve, time));
    values.forEach((value, k) => {
      if (!Number.isFinite(value)) return;
      pen.fillStyle = this.palette[k % this.palette.length];
      pen.beginPath();
      pen.arc(this.left(time), this.top(value), 3.2, 0, 7);
      pen.fill();
    });
    this.tell(pen, values);
  }

  /** The values at the cursor, below the axis, further to the left where there are many. */
  tell(pen, values) {
    pen.font = "12px system-ui, sans-serif";
    pen.textAlign = "left";
    pen.textBaseline = "bottom";
    const texts = this.curves.map(({ label, unit }, k) => `${label} ${spelled(values[k], this.digits)}${unit ? ` ${unit}` : ""}`);
    const measured = texts.map((text) => pen.measureText(text).width + GAP);
    const total = measured.reduce((before, width) => before + width, 0) - GAP, shrunk = Math.min(1, this.width / total);
    pen.font = `${12 * shrunk}px system-ui, sans-serif`;
    const widths = measured.map((width) => width * shrunk);
    let at = Math.max(0, Math.min(MARGINS.left, this.width - total));
    texts.forEach((text, k) => {
      pen.fillStyle = this.palette[k % this.palette.length];
      pen.fillText(text, at, this.height);
      at += widths[k];
    });
  }

  /** The time at a place of the canvas, within the range. */
  timeAt(left) {
    const [first, last] = this.time, share = (left - MARGINS.left) / (this.width - MARGINS.left - MARGINS.right);
    return first + Math.min(Math.max(share, 0), 1) * (last - first);
  }
}

/** A curve's value at a time, on the straight line between two samples. */
function interpolated({ times, values }, time) {
  let low = 0, high = times.length - 1;
  if (!(time >= times[0] - 1e-9 * Math.abs(time)) || high < 0) return NaN;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    [low, high] = times[middle] <= time ? [middle, high] : [low, middle];
  }
  const span = times[high] - times[low], share = span > 0 ? Math.min((time - times[low]) / span, 1) : 0;
  return share === 0 ? values[low] : share === 1 ? values[high] : values[low] + share * (values[high] - values[low]);
}
