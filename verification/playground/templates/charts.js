/* Line charts on a canvas, in the page's own colours, sharp on every screen. */
function css(name) { return getComputedStyle(document.documentElement).getPropertyValue(name).trim(); }

/* Round numbers in a range, some `most` of them at the most. */
function ticksOf(low, high, most) {
  const rough = (high - low) / Math.max(most, 1);
  const power = Math.pow(10, Math.floor(Math.log10(rough)));
  const factor = [1, 2, 2.5, 5, 10].find((one) => one * power >= rough * 0.999);
  const step = factor * power;
  const ticks = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) { ticks.push(k * step); }
  return { ticks, digits: Math.max(0, (factor === 2.5 ? 1 : 0) - Math.floor(Math.log10(step) + 1e-9)) };
}

function decadesOf(low, high, most) {
  const first = Math.ceil(Math.log10(low) - 1e-9), last = Math.floor(Math.log10(high) + 1e-9);
  const step = Math.max(1, Math.ceil((last - first + 1) / most));
  const ticks = [];
  for (let k = last; k >= first; k -= step) { ticks.push(k); }
  return ticks;
}

const RAISED = { "-": "⁻", 0: "⁰", 1: "¹", 2: "²", 3: "³", 4: "⁴", 5: "⁵", 6: "⁶", 7: "⁷", 8: "⁸", 9: "⁹" };
function raised(number) { return String(number).replace(/./g, (c) => RAISED[c]); }
function minus(text) { return text.replace("-", "−"); }

class Chart {
  /* x and y name the axes with their units; a chart with `log` has decades upwards. */
  constructor(canvas, { x, y, log = false, square = false }) {
    Object.assign(this, { canvas, x, y, log, square, shown: null, cursor: null });
    new ResizeObserver(() => this.redraw()).observe(canvas);
  }

  /* Lines: { x, y } of numbers, or { from, step, y } at even distances. */
  draw(shown) { this.shown = shown; this.redraw(); }

  redraw() {
    const { canvas, shown } = this;
    const width = canvas.clientWidth, height = canvas.clientHeight;
    if (!shown || !width || !height) { return; }
    const scale = window.devicePixelRatio || 1;
    canvas.width = Math.round(width * scale);
    canvas.height = Math.round(height * scale);
    const ink = canvas.getContext("2d");
    ink.scale(scale, scale);
    this.box = { left: 50, top: 24, right: width - 18, bottom: height - 34 };
    this.frame(ink);
    ink.save();
    ink.beginPath();
    ink.rect(this.box.left, this.box.top - 1, this.box.right - this.box.left, this.box.bottom - this.box.top + 2);
    ink.clip();
    for (const line of shown.lines) { this.line(ink, line); }
    ink.restore();
    for (const mark of shown.marks ?? []) { this.mark(ink, mark); }
    if (this.cursor !== null) { this.rule(ink, this.cursor); }
  }

  toX(x) {
    const [low, high] = this.shown.xRange;
    return this.box.left + (x - low) / (high - low) * (this.box.right - this.box.left);
  }

  toY(y) {
    let [low, high] = this.shown.yRange;
    if (this.log) { [low, high, y] = [low, high, Math.max(y, 1e-300)].map(Math.log10); }
    return this.box.bottom - (y - low) / (high - low) * (this.box.bottom - this.box.top);
  }

  /* The values at a place in the window. */
  at(event) {
    const { box, shown } = this, place = this.canvas.getBoundingClientRect();
    const [x, y] = [event.clientX - place.left, event.clientY - place.top];
    const share = [(x - box.left) / (box.right - box.left), (box.bottom - y) / (box.bottom - box.top)];
    return [shown.xRange, shown.yRange].map(([low, high], i) =>
      low + Math.min(1, Math.max(0, share[i])) * (high - low));
  }

  frame(ink) {
    const { box, shown } = this;
    const line = css("--line"), muted = css("--muted");
    ink.font = "12px system-ui, sans-serif";
    ink.lineWidth = 1;
    ink.strokeStyle = line;
    ink.fillStyle = muted;
    const [left, right] = shown.xRange, [low, high] = shown.yRange;
    const across = ticksOf(left, right, Math.floor((box.right - box.left) / 64));
    ink.textAlign = "center";
    ink.textBaseline = "top";
    for (const tick of across.ticks) {
      const x = Math.round(this.toX(tick)) + 0.5;
      this.segment(ink, x, box.top, x, box.bottom);
      ink.fillText(minus(tick.toFixed(across.digits)), x, box.bottom + 5);
    }
    ink.textAlign = "right";
    ink.textBaseline = "middle";
    const most = Math.max(2, Math.floor((box.bottom - box.top) / 34));
    const up = this.log
      ? decadesOf(low, high, most).map((k) => [Math.pow(10, k), `10${raised(k)}`])
      : (({ ticks, digits }) => ticks.map((t) => [t, minus(t.toFixed(digits))]))(ticksOf(low, high, most));
    for (const [tick, text] of up) {
      const y = Math.round(this.toY(tick)) + 0.5;
      this.segment(ink, box.left, y, box.right, y);
      ink.fillText(text, box.left - 6, y);
    }
    if (!this.log && low < 0 && high > 0) {
      ink.strokeStyle = muted;
      const y = Math.round(this.toY(0)) + 0.5;
      this.segment(ink, box.left, y, box.right, y);
      if (left < 0 && right > 0) {
        const x = Math.round(this.toX(0)) + 0.5;
        this.segment(ink, x, box.top, x, box.bottom);
      }
    }
    ink.fillStyle = css("--ink");
    ink.textBaseline = "alphabetic";
    ink.textAlign = "left";
    ink.fillText(this.y, 4, 13);
    ink.textAlign = "right";
    ink.fillText(this.x, box.right, box.bottom + 30);
  }

  segment(ink, x1, y1, x2, y2) {
    ink.beginPath();
    ink.moveTo(x1, y1);
    ink.lineTo(x2, y2);
    ink.stroke();
  }

  line(ink, line) {
    ink.strokeStyle = css(line.colour);
    ink.globalAlpha = line.alpha ?? 1;
    ink.lineWidth = line.width ?? 1.4;
    ink.lineJoin = "round";
    ink.setLineDash(line.dash ?? []);
    ink.beginPath();
    if (line.x) {
      for (let i = 0; i < line.x.length; i++) { ink.lineTo(this.toX(line.x[i]), this.toY(line.y[i])); }
    } else {
      this.trace(ink, line);
    }
    ink.stroke();
    ink.setLineDash([]);
    if (line.arrow) { this.arrow(ink, line); }
    ink.globalAlpha = 1;
  }

  /* Of many samples in a column of pixels the least and the greatest are enough. */
  trace(ink, { from, step, y }) {
    const [left, right] = this.shown.xRange;
    const first = Math.max(0, Math.floor((left - from) / step));
    const last = Math.min(y.length - 1, Math.ceil((right - from) / step));
    const per = Math.max(1, Math.floor((last - first) / (this.box.right - this.box.left)));
    for (let i = first; i <= last; i += per) {
      let least = i, most = i;
      for (let k = i + 1; k < Math.min(i + per, last + 1); k++) {
        if (y[k] < y[least]) { least = k; }
        if (y[k] > y[most]) { most = k; }
      }
      for (const k of least < most ? [least, most] : least > most ? [most, least] : [least]) {
        ink.lineTo(this.toX(from + k * step), this.toY(y[k]));
      }
    }
  }

  /* A head where a trajectory has gone a third of its way across the chart. */
  arrow(ink, { x, y, arrow }) {
    let way = 0;
    for (let i = 1; i < x.length; i++) {
      const [a, b] = [this.toX(x[i - 1]), this.toY(y[i - 1])], [c, d] = [this.toX(x[i]), this.toY(y[i])];
      way += Math.hypot(c - a, d - b);
      if (way < arrow * (this.box.right - this.box.left) || (a === c && b === d)) { continue; }
      const angle = Math.atan2(d - b, c - a);
      ink.fillStyle = ink.strokeStyle;
      ink.beginPath();
      ink.moveTo(c, d);
      for (const side of [2.65, -2.65]) { ink.lineTo(c + 8 * Math.cos(angle + side), d + 8 * Math.sin(angle + side)); }
      ink.fill();
      return;
    }
  }

  /* A dot with its place, or a horizontal line with a word. */
  mark(ink, { x, y, colour, text }) {
    ink.fillStyle = ink.strokeStyle = css(colour);
    if (x !== undefined) {
      ink.beginPath();
      ink.arc(this.toX(x), this.toY(y), 5, 0, 2 * Math.PI);
      ink.fill();
      return;
    }
    const height = this.toY(y);
    if (height < this.box.top || height > this.box.bottom) { return; }
    ink.setLineDash([4, 4]);
    ink.lineWidth = 1;
    this.segment(ink, this.box.left, height, this.box.right, height);
    ink.setLineDash([]);
    ink.textAlign = "right";
    ink.fillText(text, this.box.right - 4, height - 5);
  }

  /* Where the pointer is. */
  rule(ink, x) {
    const [left, right] = this.shown.xRange;
    if (x < left || x > right) { return; }
    ink.strokeStyle = css("--ink");
    ink.globalAlpha = 0.5;
    this.segment(ink, this.toX(x), this.box.top, this.toX(x), this.box.bottom);
    ink.globalAlpha = 1;
    for (const { from, step, y, colour, dot } of this.shown.lines) {
      const value = dot && y[Math.round((x - from) / step)];
      if (value === undefined || value === false) { continue; }
      ink.fillStyle = css(colour);
      ink.beginPath();
      ink.arc(this.toX(x), this.toY(value), 3.5, 0, 2 * Math.PI);
      ink.fill();
    }
  }
}

/* A symmetric range around all that is finite, or one with a margin. */
function rangeOf(lines, { about = null, least = 0 } = {}) {
  let low = Infinity, high = -Infinity;
  for (const values of lines) {
    for (const one of values) {
      if (Number.isFinite(one)) { low = Math.min(low, one); high = Math.max(high, one); }
    }
  }
  if (low > high) { return [-1, 1]; }
  if (about !== null) {
    const reach = 1.08 * Math.max(high - about, about - low, least);
    return [about - reach, about + reach];
  }
  const margin = Math.max(0.06 * (high - low), least);
  return [low - margin, high + margin];
}
