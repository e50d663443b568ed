// Copyright 2026 ride_estimation contributors
// Plots of a report: drawn as SVG from the numbers in the page, with cursor, zoom and export. Nothing is loaded from outside.
'use strict';
(() => {
// asked of the browser, so that a page holds no address at all and that can be checked
const SVG = new DOMParser().parseFromString('<svg></svg>', 'text/html').querySelector('svg').namespaceURI;
const NARROW = 700; // [px] below, panels stand one below the other
const GAP = -32768, STEPS = 65534;

function bytes(text) { return Uint8Array.from(atob(text), c => c.charCodeAt(0)); }

function decoded(a) {
  if (a.t === 'u') return Float64Array.from({length: a.n}, (_, i) => a.a + i * a.s);
  const raw = bytes(a.b).buffer;
  if (a.t === 'f') return Float64Array.from(new Float32Array(raw));
  const span = a.z - a.a;
  return Float64Array.from(new Int16Array(raw), v => v === GAP ? NaN : a.a + span * (v + STEPS / 2) / STEPS);
}

function node(name, attributes, parent, text) {
  const made = document.createElementNS(SVG, name);
  for (const key in attributes) made.setAttribute(key, attributes[key]);
  if (text !== undefined) made.textContent = text;
  if (parent) parent.appendChild(made);
  return made;
}

function short(v, digits = 4) {
  if (!Number.isFinite(v)) return '-';
  if (v === 0) return '0';
  const size = Math.abs(v);
  return size >= 1e7 || size < 1e-4 ? v.toExponential(digits - 2) : String(Number(v.toPrecision(digits)));
}

function ticks(low, high, log, room) {
  const most = Math.max(3, Math.floor(room));
  if (log) {
    const first = Math.floor(Math.log10(low)), last = Math.ceil(Math.log10(high));
    for (const [parts, every] of [[[1, 2, 5], 1], [[1], 1], [[1], 2], [[1], 3], [[1], 5]]) {
      const found = [];
      for (let e = first; e <= last; e += every) for (const p of parts) {
        const v = p * 10 ** e;
        if (v >= low * (1 - 1e-9) && v <= high * (1 + 1e-9)) found.push(v);
      }
      if (found.length <= most && (found.length > 1 || every > 1)) return found;
    }
  }
  const raw = (high - low) / most, power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map(f => f * power).find(s => s >= raw * 0.999) || power;
  const found = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + 1e-9 * step; i++) found.push(Number((i * step).toPrecision(12)));
  return found;
}

function rising(x) {
  for (let i = 1; i < x.length; i++) if (!(x[i] >= x[i - 1])) return false;
  return x.length > 1;
}

function below(x, v) { // first index with x[i] >= v
  let low = 0, high = x.length;
  while (low < high) { const m = (low + high) >> 1; if (x[m] < v) low = m + 1; else high = m; }
  return low;
}

class Panel {
  constructor(spec, chart) {
    this.spec = spec;
    this.chart = chart;
    this.x = spec.x.lim.slice();
    this.y = spec.y.lim.slice();
    this.items = spec.items.map(i => ({...i}));
    for (const item of this.items) {
      for (const key of ['x', 'y', 'lo', 'hi']) if (item[key] !== undefined) item[key] = chart.arrays[item[key]];
      if (item.x && item.k !== 'points') item.rising = rising(item.x);
    }
    this.curves = this.items.filter(i => i.x);
    this.overTime = this.curves.length > 0 && this.curves.every(i => i.rising || i.k === 'points');
  }
  sx(v) { return this.place(v, this.x, this.spec.x.log, this.box[0], this.box[2]); }
  sy(v) { return this.box[1] + this.box[3] - this.place(v, this.y, this.spec.y.log, 0, this.box[3]); }
  place(v, [a, b], log, start, length) {
    return start + length * (log ? Math.log(v / a) / Math.log(b / a) : (v - a) / (b - a));
  }
  back(px, [a, b], log, start, length) {
    const share = (px - start) / length;
    return log ? a * (b / a) ** share : a + share * (b - a);
  }
  xAt(px) { return this.back(px, this.x, this.spec.x.log, this.box[0], this.box[2]); }
  yAt(py) { return this.back(this.box[1] + this.box[3] - py, this.y, this.spec.y.log, 0, this.box[3]); }

  draw(svg, number) {
    const [l, t, w, h] = this.box, id = `${this.chart.id}p${number}`;
    const clip = node('clipPath', {id}, svg);
    node('rect', {x: l, y: t, width: w, height: h}, clip);
    const under = node('g', {}, svg), marks = node('g', {'clip-path': `url(#${id})`}, svg);
    for (const v of this.spec.x.ticks || ticks(...this.x, this.spec.x.log, w / (this.spec.x.log ? 36 : 62))) {
      const x = this.sx(v);
      if (x < l - 0.5 || x > l + w + 0.5) continue;
      node('line', {x1: x, x2: x, y1: t, y2: t + h, class: 'grid'}, under);
      if (this.spec.x.numbers) node('text', {x, y: t + h + 15, 'text-anchor': 'middle'}, svg, short(v, 6));
    }
    let widest = 0;
    for (const v of this.spec.y.ticks || ticks(...this.y, this.spec.y.log, h / 30)) {
      const y = this.sy(v);
      if (y < t - 0.5 || y > t + h + 0.5) continue;
      node('line', {x1: l, x2: l + w, y1: y, y2: y, class: 'grid'}, under);
      node('text', {x: l - 5, y: y + 4, 'text-anchor': 'end'}, svg, short(v, 6));
      widest = Math.max(widest, short(v, 6).length);
    }
    for (const item of this.items) if (!this.chart.hidden.has(item.n + item.c)) this.drawItem(item, marks);
    node('rect', {x: l, y: t, width: w, height: h, class: 'frame'}, svg);
    if (this.spec.title) {
      const size = Math.max(8, Math.min(12, w / (0.58 * this.spec.title.length)));
      node('text', {x: l + 2, y: t - 6, 'font-weight': 600, 'font-size': size}, svg, this.spec.title);
    }
    if (this.spec.x.label && this.spec.x.numbers) node('text', {x: l + w / 2, y: t + h + 32, 'text-anchor': 'middle'}, svg, this.spec.x.label);
    if (this.spec.y.label) {
      const x = Math.max(10, l - 13 - 7 * widest), y = t + h / 2;
      const size = Math.min(12, Math.max(9, 12 * (h + 14) / (6.4 * this.spec.y.label.length)));
      const words = this.wrapped(this.spec.y.label, h / (0.53 * size));
      words.forEach((word, i) => node('text', {
        x, y, 'text-anchor': 'middle', 'font-size': size, transform: `rotate(-90 ${x} ${y})`, dy: (i - words.length + 1) * 12,
      }, svg, word));
    }
    if (this.spec.bar) this.drawBar(svg);
    this.line = node('line', {y1: t, y2: t + h, class: 'cursor', visibility: 'hidden'}, svg);
  }

  wrapped(label, most) { // the unit goes to a second line where the panel is low
    if (label.length <= most) return [label];
    const cut = label.lastIndexOf(' [');
    return cut > 0 ? [label.slice(0, cut), label.slice(cut + 1)] : [label];
  }

  drawItem(item, g) {
    const [l, t, w, h] = this.box;
    const stroke = {fill: 'none', stroke: item.c, 'stroke-width': Math.max(item.w || 1, 0.9), 'stroke-dasharray': (item.d || []).join(' '), 'stroke-linejoin': 'round', 'stroke-opacity': item.o === undefined ? 1 : item.o};
    if (item.k === 'level') node('line', {x1: l, x2: l + w, y1: this.sy(item.v), y2: this.sy(item.v), ...stroke}, g);
    else if (item.k === 'mark') node('line', {x1: this.sx(item.v), x2: this.sx(item.v), y1: t, y2: t + h, ...stroke}, g);
    else if (item.k === 'image') {
      const a = this.sx(item.box[0]), b = this.sx(item.box[1]), c = this.sy(item.box[3]), d = this.sy(item.box[2]);
      node('image', {x: a, y: c, width: b - a, height: d - c, href: this.picture(item), preserveAspectRatio: 'none', style: 'image-rendering:pixelated'}, g);
    } else if (item.k === 'bars') {
      let path = '';
      const zero = this.sy(Math.max(0, this.y[0]));
      for (let i = 0; i < item.x.length; i++) {
        const a = this.sx(item.x[i]), b = this.sx(item.x[i] + item.w);
        path += `M${a.toFixed(1)} ${zero.toFixed(1)}V${this.sy(item.y[i]).toFixed(1)}H${b.toFixed(1)}V${zero.toFixed(1)}z`;
      }
      node('path', {d: path, fill: item.c}, g);
    } else if (item.k === 'points') {
      for (let i = 0; i < item.x.length; i++) node('circle', {cx: this.sx(item.x[i]).toFixed(1), cy: this.sy(item.y[i]).toFixed(1), r: item.m, fill: item.cs.length ? item.cs[i] : item.c}, g);
    } else if (item.k === 'band') {
      const [xs, low] = this.thinned(item, item.lo, -1), [back, high] = this.thinned(item, item.hi, 1);
      const d = this.path(xs, low) + this.path(Array.from(back).reverse(), Array.from(high).reverse()).replace('M', 'L');
      if (d) node('path', {d: d + 'z', fill: item.c, 'fill-opacity': item.o}, g);
    } else {
      const [xs, ys] = this.thinned(item, item.y, 0);
      node('path', {d: this.path(xs, ys), ...stroke}, g);
      if (item.m && xs.length < 400) for (let i = 0; i < xs.length; i++) if (Number.isFinite(ys[i])) {
        node('circle', {cx: this.sx(xs[i]).toFixed(1), cy: this.sy(ys[i]).toFixed(1), r: item.m, fill: item.c}, g);
      }
    }
  }

  // what a curve looks like at this width: per pixel column its extremes (side 0), its lowest (-1) or its highest value (1)
  thinned(item, y, side) {
    const x = item.x;
    if (!item.rising) return [x, y];
    const first = Math.max(0, below(x, this.x[0]) - 1), last = Math.min(x.length, below(x, this.x[1]) + 2);
    const columns = Math.ceil(this.box[2]);
    if (last - first <= 3 * columns) return [x.subarray(first, last), y.subarray(first, last)];
    const xs = [], ys = [];
    for (let c = 0; c < columns; c++) {
      const from = first + Math.floor((last - first) * c / columns), to = first + Math.floor((last - first) * (c + 1) / columns);
      let low = from, high = from;
      for (let i = from; i < to; i++) { if (y[i] < y[low]) low = i; if (y[i] > y[high]) high = i; }
      for (const i of side < 0 ? [low] : side > 0 ? [high] : low < high ? [low, high] : [high, low]) { xs.push(x[i]); ys.push(y[i]); }
    }
    return [xs, ys];
  }

  path(xs, ys) {
    let d = '', open = false;
    for (let i = 0; i < xs.length; i++) {
      const x = this.sx(xs[i]), y = this.sy(ys[i]);
      if (Number.isNaN(x) || Number.isNaN(y)) { open = false; continue; }
      d += `${open ? 'L' : 'M'}${x.toFixed(1)} ${Math.max(-1e4, Math.min(1e4, y)).toFixed(1)}`;
      open = true;
    }
    return d;
  }

  picture(item) {
    if (!item.url) {
      const canvas = document.createElement('canvas');
      canvas.width = item.cols;
      canvas.height = item.rows;
      const context = canvas.getContext('2d'), data = context.createImageData(item.cols, item.rows);
      const levels = item.levels = bytes(item.b), palette = item.palette = bytes(item.p);
      for (let r = 0; r < item.rows; r++) for (let c = 0; c < item.cols; c++) {
        const level = levels[r * item.cols + c], to = 4 * ((item.rows - 1 - r) * item.cols + c);
        if (level) data.data.set([...palette.subarray(3 * level - 3, 3 * level), 255], to);
      }
      context.putImageData(data, 0, 0);
      item.url = canvas.toDataURL();
    }
    return item.url;
  }

  drawBar(svg) {
    const item = this.items.find(i => i.k === 'image'), [l, t, w, h] = this.box, x = l + w + 10;
    this.picture(item);
    for (let i = 0; i < 64; i++) {
      const p = item.palette.subarray(3 * (4 * i), 3 * (4 * i) + 3);
      node('rect', {x, y: t + h * (63 - i) / 64, width: 10, height: h / 64 + 0.5, fill: `rgb(${p.join()})`}, svg);
    }
    const [a, b] = item.lim;
    for (const v of ticks(a, b, item.log, h / 34)) {
      node('text', {x: x + 14, y: t + h - this.place(v, item.lim, item.log, 0, h) + 4}, svg, short(v, 4));
    }
    const tx = x + 50, ty = t + h / 2;
    node('text', {x: tx, y: ty, 'text-anchor': 'middle', transform: `rotate(-90 ${tx} ${ty})`}, svg, this.spec.bar);
  }

  // of panels that share their x axis one carries its label
  xLabel() { return this.spec.x.label || this.chart.panels.find(p => p.spec.group === this.spec.group && p.spec.x.label)?.spec.x.label || 'x'; }

  // rows of the readout at a place: [colour, name, value]
  read(px, py) {
    const rows = [], x = this.xAt(px);
    const named = item => item.n || this.spec.y.label.replace(/ \[.*/, '');
    const image = this.items.find(i => i.k === 'image');
    if (image) {
      const [a, b, c, d] = image.box, col = Math.floor((x - a) / (b - a) * image.cols), row = Math.floor((this.yAt(py) - c) / (d - c) * image.rows);
      const level = image.levels[row * image.cols + col], share = (level - 1) / 254, [low, high] = image.lim;
      const value = image.log ? low * (high / low) ** share : low + share * (high - low);
      return [['', this.xLabel(), short(x)], ['', this.spec.y.label, short(this.yAt(py))], ['', this.spec.bar || 'value', level ? short(value, 3) : '-']];
    }
    if (this.overTime) {
      let at = NaN;
      for (const item of this.curves) {
        if (this.chart.hidden.has(item.n + item.c) || !item.rising) continue;
        let i = Math.min(below(item.x, x), item.x.length - 1);
        if (item.k !== 'bars' && i > 0 && x - item.x[i - 1] < item.x[i] - x) i--;
        if (item.k === 'bars' && i > 0 && item.x[i] > x) i--;
        if (Number.isNaN(at)) at = item.x[i];
        const value = item.k === 'band' ? `${short(item.lo[i])} to ${short(item.hi[i])}` : short(item.y[i]);
        rows.push([item.c, item.k === 'band' ? item.n || '± 2 std' : named(item), value]);
      }
      if (rows.length) rows.unshift(['', this.xLabel(), short(at, 5)]);
      if (rows.length || !this.curves.length) return rows;
    }
    let best = 24 ** 2, found = null;
    for (const item of this.curves) {
      if (!item.y || this.chart.hidden.has(item.n + item.c)) continue;
      for (let i = 0; i < item.x.length; i++) {
        const far = (this.sx(item.x[i]) - px) ** 2 + (this.sy(item.y[i]) - py) ** 2;
        if (far < best) { best = far; found = [item, i]; }
      }
    }
    if (!found) return [['', this.xLabel(), short(x)], ['', this.spec.y.label, short(this.yAt(py))]];
    const [item, i] = found;
    if (item.n) rows.push([item.c, item.n, '']);
    return [...rows, ['', this.xLabel(), short(item.x[i])], ['', this.spec.y.label, short(item.y[i])]];
  }

  // the range of what is seen between two x, so that a zoom along x fills the panel
  fitY() {
    let low = Infinity, high = -Infinity;
    for (const item of this.curves) {
      const pairs = item.k === 'band' ? [item.lo, item.hi] : [item.y];
      for (let i = 0; i < item.x.length; i++) if (item.x[i] >= this.x[0] && item.x[i] <= this.x[1]) for (const y of pairs) {
        if (Number.isFinite(y[i]) && (!this.spec.y.log || y[i] > 0)) { low = Math.min(low, y[i]); high = Math.max(high, y[i]); }
      }
    }
    if (!(high > low)) return;
    if (this.spec.y.log) this.y = [low / 1.15, high * 1.15];
    else { const room = 0.05 * (high - low); this.y = [low - room, high + room]; }
  }
}

class Chart {
  constructor(figure, number) {
    const spec = JSON.parse(figure.querySelector('script').textContent);
    this.figure = figure;
    this.id = `c${number}`;
    this.size = spec.size;
    this.arrays = spec.arrays.map(decoded);
    this.hidden = new Set();
    this.panels = spec.panels.map(p => new Panel(p, this));
    this.plot = figure.querySelector('.plot');
    this.caption = figure.querySelector('figcaption').textContent;
    this.readout = document.createElement('div');
    this.readout.className = 'readout';
    this.tools(figure.querySelector('.tools'));
    new ResizeObserver(() => { if (Math.abs(this.plot.clientWidth - this.width) > 2) this.draw(); }).observe(this.plot);
    this.draw();
  }

  tools(place) {
    const known = new Set();
    for (const panel of this.panels) if (panel.spec.legend) for (const item of panel.items) {
      const key = item.n + item.c;
      if (!item.n || known.has(key)) continue;
      known.add(key);
      const entry = document.createElement('span');
      entry.className = 'key';
      entry.title = 'hide or show';
      const svg = node('svg', {viewBox: '0 0 24 10'}, entry);
      if (item.k === 'line') node('line', {x1: 0, x2: 24, y1: 5, y2: 5, stroke: item.c, 'stroke-width': 2.2, 'stroke-dasharray': item.d.join(' ')}, svg);
      else if (item.k === 'points') node('circle', {cx: 12, cy: 5, r: 3.5, fill: item.c}, svg);
      else node('rect', {x: 0, y: 0, width: 24, height: 10, fill: item.c, 'fill-opacity': item.o || 1}, svg);
      entry.append(item.n);
      entry.onclick = () => {
        this.hidden[this.hidden.has(key) ? 'delete' : 'add'](key);
        entry.classList.toggle('off');
        this.draw();
      };
      place.append(entry);
    }
    const gap = document.createElement('span');
    gap.className = 'gap';
    place.append(gap);
    this.reset = this.button(place, 'reset zoom', () => {
      for (const p of this.panels) { p.x = p.spec.x.lim.slice(); p.y = p.spec.y.lim.slice(); }
      this.reset.hidden = true;
      this.draw();
    });
    this.reset.hidden = true;
    this.button(place, 'CSV', () => this.save('csv', 'text/csv', this.csv()));
    this.button(place, 'SVG', () => this.save('svg', 'image/svg+xml', this.picture()));
  }

  button(place, text, action) {
    const made = document.createElement('button');
    made.type = 'button';
    made.textContent = text;
    made.onclick = action;
    place.append(made);
    return made;
  }

  layout() {
    this.width = this.plot.clientWidth;
    this.narrow = this.width < NARROW;
    const [w, h] = this.size;
    if (!this.narrow) {
      this.height = this.width * h / w;
      for (const p of this.panels) {
        const [x, y, pw, ph] = p.spec.box;
        p.box = [x * this.width, y * this.height, pw * this.width, ph * this.height];
      }
      return;
    }
    let top = 0;
    for (const p of this.panels) {
      p.spec.stack = [p.spec.box[1], p.spec.box[0]];
    }
    for (const p of [...this.panels].sort((a, b) => a.spec.stack[0] - b.spec.stack[0] || a.spec.stack[1] - b.spec.stack[1])) {
      const ph = Math.max(80, Math.min(230, p.spec.box[3] * h * 85));
      top += p.spec.title ? 22 : 8;
      p.box = [66, top, this.width - 66 - (p.spec.bar ? 66 : 10), ph];
      top += ph + (p.spec.x.numbers ? (p.spec.x.label ? 40 : 22) : 4);
    }
    this.height = top;
  }

  draw() {
    this.layout();
    const svg = node('svg', {viewBox: `0 0 ${this.width} ${this.height}`, role: 'img', 'aria-label': this.caption});
    this.panels.forEach((p, i) => p.draw(svg, i));
    this.svg = svg;
    this.plot.replaceChildren(svg, this.readout);
    svg.onpointermove = e => this.move(e);
    svg.onpointerleave = () => { if (!this.start) this.clear(); };
    svg.onpointerdown = e => this.begin(e);
    svg.onpointerup = e => this.end(e);
    svg.onpointercancel = () => { this.start = null; this.drag?.remove(); };
    svg.ondblclick = () => this.reset.click();
  }

  at(event) {
    const box = this.svg.getBoundingClientRect(), scale = this.width / box.width;
    return [(event.clientX - box.left) * scale, (event.clientY - box.top) * scale];
  }

  under([x, y]) { return this.panels.find(p => x >= p.box[0] && x <= p.box[0] + p.box[2] && y >= p.box[1] && y <= p.box[1] + p.box[3]); }

  clear() {
    this.readout.style.display = 'none';
    for (const p of this.panels) p.line.setAttribute('visibility', 'hidden');
  }

  move(event) {
    const at = this.at(event), panel = this.start ? this.start.panel : this.under(at);
    if (this.start) this.stretch(at);
    this.clear();
    if (!panel) return;
    const rows = panel.read(...at);
    const x = panel.xAt(at[0]);
    for (const p of this.panels) if (panel.overTime && p.spec.group === panel.spec.group && x >= p.x[0] && x <= p.x[1]) {
      p.line.setAttribute('x1', p.sx(x));
      p.line.setAttribute('x2', p.sx(x));
      p.line.setAttribute('visibility', 'visible');
    }
    if (!rows.length) return;
    this.readout.replaceChildren(...rows.map(([colour, name, value]) => {
      const line = document.createElement('div'), mark = document.createElement('i');
      mark.style.background = colour || 'transparent';
      const unit = /\[(.*)\]$/.exec(name);
      line.append(...(colour ? [mark] : []), `${unit ? name.slice(0, unit.index).trim() : name}${value ? ': ' : ''}${value}${unit && unit[1] !== '-' ? ' ' + unit[1] : ''}`);
      return line;
    }));
    this.readout.style.display = 'block';
    const scale = this.plot.clientWidth / this.width, room = this.plot.clientWidth - this.readout.offsetWidth;
    const left = at[0] * scale + 14 > room ? at[0] * scale - 14 - this.readout.offsetWidth : at[0] * scale + 14;
    this.readout.style.left = `${Math.max(0, Math.min(room, left))}px`;
    this.readout.style.top = `${Math.max(0, at[1] * scale - this.readout.offsetHeight - 8)}px`;
  }

  begin(event) {
    const at = this.at(event), panel = this.under(at);
    if (!panel || event.button) return;
    this.start = {panel, at};
    this.drag = node('rect', {class: 'drag', width: 0, height: 0}, this.svg);
    this.svg.setPointerCapture(event.pointerId);
  }

  stretch(at) {
    const {panel, at: from} = this.start, [l, t, w, h] = panel.box;
    const x = Math.max(l, Math.min(l + w, at[0])), y = Math.max(t, Math.min(t + h, at[1]));
    const both = !panel.overTime;
    const set = {x: Math.min(x, from[0]), width: Math.abs(x - from[0]), y: both ? Math.min(y, from[1]) : t, height: both ? Math.abs(y - from[1]) : h};
    for (const key in set) this.drag.setAttribute(key, set[key]);
    this.start.to = [x, y];
  }

  end() {
    const {panel, at, to} = this.start || {};
    this.drag?.remove();
    this.start = null;
    if (!to || Math.abs(to[0] - at[0]) < 6 || (!panel.overTime && Math.abs(to[1] - at[1]) < 6)) return;
    const range = [panel.xAt(Math.min(at[0], to[0])), panel.xAt(Math.max(at[0], to[0]))];
    if (!panel.overTime) {
      panel.y = [panel.yAt(Math.max(at[1], to[1])), panel.yAt(Math.min(at[1], to[1]))];
      panel.x = range;
    } else for (const p of this.panels) if (p.spec.group === panel.spec.group) { p.x = range.slice(); p.fitY(); }
    this.reset.hidden = false;
    this.draw();
  }

  csv() {
    const columns = [];
    for (const p of this.panels) for (const item of p.curves) {
      const head = [p.spec.title, item.n].filter(Boolean).join(' ');
      columns.push([`${head} ${p.xLabel()}`.trim(), item.x]);
      for (const [key, word] of [['y', ''], ['lo', ' lower'], ['hi', ' upper']]) if (item[key]) columns.push([`${head} ${p.spec.y.label}${word}`.trim(), item[key]]);
    }
    const quoted = text => `"${text.replace(/^[=+\-@]/, "'$&").replaceAll('"', '""')}"`; // no formula for a spreadsheet
    const lines = [columns.map(c => quoted(c[0])).join()];
    const rows = Math.max(0, ...columns.map(c => c[1].length));
    for (let i = 0; i < rows; i++) lines.push(columns.map(c => i < c[1].length && Number.isFinite(c[1][i]) ? Number(c[1][i].toPrecision(7)) : '').join());
    return lines.join('\n') + '\n';
  }

  picture() {
    const copy = this.svg.cloneNode(true);
    copy.setAttribute('width', this.width);
    copy.setAttribute('height', this.height);
    copy.setAttribute('font-family', 'sans-serif');
    copy.setAttribute('font-size', 12);
    const style = node('style', {}, null, '.grid{stroke:#e4e8ec}.frame{fill:none;stroke:#8c959f}.cursor{display:none}');
    copy.prepend(style);
    return new XMLSerializer().serializeToString(copy);
  }

  save(kind, type, text) {
    const link = document.createElement('a');
    link.href = URL.createObjectURL(new Blob([text], {type}));
    link.download = `${this.caption.toLowerCase().replace(/[^a-z0-9]+/g, '_').replace(/^_|_$/g, '').slice(0, 60)}.${kind}`;
    link.click();
    URL.revokeObjectURL(link.href);
  }
}

document.querySelectorAll('figure.chart').forEach((figure, number) => { figure.chart = new Chart(figure, number); });
})();
