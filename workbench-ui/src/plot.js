// A plot that is zoomed by dragging or by buttons, and saved.
import * as Plot from "@observablehq/plot";
import { button, csv, make, save } from "./dom.js";

const LEFT = 56, LETTER = 6; // pixels: the margin of the axis, and about the width of a letter

// Ten colours; the next ten series have them again, with other dots and dashes.
const COLOURS = 10, DOTS = ["circle", "triangle", "square", "diamond", "star"], SIGNS = "●▲■◆★", DASHES = ["none", "7 3", "2 3", "8 3 2 3", "14 4"];
const round = (i) => Math.floor(i / COLOURS) % DOTS.length;

const cut = (text, letters) => (text.length > letters ? `${text.slice(0, letters - 1)}…` : text);

/** A text of the legend. */
function text(content, attributes) {
  const element = document.createElementNS("http://www.w3.org/2000/svg", "text");
  element.textContent = content;
  for (const [key, value] of Object.entries({ "text-anchor": "start", ...attributes })) element.setAttribute(key, value);
  return element;
}

/** Ticks at whole numbers only, where there are no others and few. */
function ticks(points, zoomed) {
  const places = points.map((p) => p.x), [low, high] = zoomed ?? [Math.min(...places), Math.max(...places)];
  if (!places.every(Number.isInteger) || high - low > 12) return {};
  const first = Math.ceil(low);
  return { ticks: Array.from({ length: Math.floor(high) - first + 1 }, (_, i) => first + i), tickFormat: "d" };
}

/** Lines of points {x, y, low, high, series}; `steps`: a line keeps its value until the next point. */
export class Chart {
  constructor(box, name, { steps = false } = {}) {
    Object.assign(this, { box, name, steps, points: [], zoomed: null, x: "", y: "" });
    box.hidden = true;
    this.figure = make("div", { class: "chart", tabindex: "0", role: "img", "aria-label": `Plot: ${name}` });
    this.table = null; // the text of the CSV file, if it is not that of the points
    box.append(this.figure, make("div", { class: "bar" },
      button("Zoom in", () => this.scale(0.6)), button("Zoom out", () => this.scale(1 / 0.6)), button("Whole", () => this.zoom(null)),
      button("PNG", () => this.png()), button("SVG", () => save(`${this.name}.svg`, this.svg(), "image/svg+xml")),
      button("CSV", () => save(`${this.name}.csv`, this.table ?? this.data(), "text/csv"))));
    new ResizeObserver(() => this.draw()).observe(this.figure);
    this.figure.addEventListener("dblclick", () => this.zoom(null));
    this.drag();
  }

  show(points, x, y, table = null) {
    Object.assign(this, { points, x, y, table });
    if (!points.length) this.zoomed = null;
    this.box.hidden = !points.length;
    this.draw();
  }

  draw() {
    const width = this.figure.clientWidth;
    if (!width) return;
    const { points, steps } = this;
    const series = [...new Set(points.map((p) => p.series))];
    const numeric = points.every((p) => typeof p.x === "number");
    const bounded = points.filter((p) => p.high > p.low);
    const style = getComputedStyle(this.figure);
    const letters = Math.floor((width - LEFT - 24) / LETTER);
    const names = series.map((name) => cut(name, letters));
    const columns = Math.max(1, Math.floor((width - LEFT) / (LETTER * Math.max(...names.map((n) => n.length), 0) + 28)));
    const lines = Math.ceil(names.length / columns), legend = 14 * lines;
    this.drawn = Plot.plot({
      width, height: Math.max(220, Math.min(310, width * 0.6)) + legend, marginRight: 24, marginLeft: LEFT, marginTop: 30 + legend, marginBottom: 36, inset: 5,
      style: { background: style.getPropertyValue("--back"), color: style.color, fontFamily: "system-ui, sans-serif" },
      x: { label: this.x, type: numeric ? "linear" : "point", ...(numeric ? ticks(points, this.zoomed?.x) : {}), ...(this.zoomed && numeric ? { domain: this.zoomed.x } : {}) },
      y: { label: this.y, axis: null, ...(this.zoomed ? { domain: this.zoomed.y } : {}) },
      color: { domain: series, scheme: "observable10" },
      symbol: { domain: series, range: series.map((_, i) => DOTS[round(i)]) },
      marks: points.length ? [
        Plot.gridY(), Plot.axisY({ label: null }),
        Plot.text([`↑ ${cut(this.y, letters)}`], { frameAnchor: "top-left", textAnchor: "start", dx: 8 - LEFT, dy: -16 }), // below the legend
        Plot.ruleX(bounded, { x: "x", y1: "low", y2: "high", z: null, stroke: "series", strokeOpacity: 0.6, clip: true }),
        ...DASHES.map((strokeDasharray, i) => Plot.lineY(points.filter((p) => round(series.indexOf(p.series)) === i), { x: "x", y: "y", z: "series", stroke: "series", strokeDasharray, curve: steps ? "step-after" : "linear", clip: true })),
        Plot.dot(points.length > 300 ? [] : points, { x: "x", y: "y", z: null, fill: "series", r: 2.5, clip: true, ...(series.length > COLOURS ? { symbol: "series" } : {}) }),
        Plot.tip(points, Plot.pointer({ x: "x", y: "y", z: null, stroke: "series", fill: style.getPropertyValue("--back") })),
      ] : [],
    });
    const step = (width - LEFT) / columns;
    names.forEach((name, i) => {
      const colour = this.drawn.scale("color").apply(series[i]);
      const [x, y] = [LEFT + step * Math.floor(i / lines), 12 + 14 * (i % lines)];
      this.drawn.append(text(SIGNS[round(i)], { x, y, fill: colour }), text(name, { x: x + 12, y, fill: "currentColor" }));
    });
    this.figure.replaceChildren(this.drawn);
  }

  domains() {
    const [x, y] = ["x", "y"].map((axis) => this.drawn?.scale(axis));
    return x?.invert && y?.invert ? { x, y } : null;
  }

  zoom(to) {
    this.zoomed = to;
    this.draw();
  }

  scale(by) {
    const scales = this.domains();
    if (!scales) return;
    const part = ({ domain: [low, high] }) => [(low + high) / 2 - (by * (high - low)) / 2, (low + high) / 2 + (by * (high - low)) / 2];
    this.zoom({ x: part(scales.x), y: part(scales.y) });
  }

  drag() {
    let from = null;
    const frame = make("div", { class: "frame", hidden: true });
    const place = (event) => {
      const box = this.figure.getBoundingClientRect();
      return [event.clientX - box.x, event.clientY - box.y];
    };
    this.figure.addEventListener("pointerdown", (event) => {
      if (event.button || event.pointerType === "touch" || !this.domains()) return;
      from = place(event);
      this.figure.append(frame);
    });
    this.figure.addEventListener("pointermove", (event) => {
      if (!from) return;
      const [x, y] = place(event);
      frame.hidden = false;
      Object.assign(frame.style, { left: `${Math.min(x, from[0])}px`, top: `${Math.min(y, from[1])}px`, width: `${Math.abs(x - from[0])}px`, height: `${Math.abs(y - from[1])}px` });
    });
    addEventListener("pointerup", (event) => {
      if (!from) return;
      const to = place(event), start = from, scales = this.domains();
      from = null;
      frame.hidden = true;
      if (Math.abs(to[0] - start[0]) < 8 || Math.abs(to[1] - start[1]) < 8) return;
      const ends = (i, scale) => [scale.invert(start[i]), scale.invert(to[i])].sort((a, b) => a - b);
      this.zoom({ x: ends(0, scales.x), y: ends(1, scales.y) });
    });
  }

  svg() {
    const copy = this.drawn.cloneNode(true);
    copy.setAttribute("xmlns", "http://www.w3.org/2000/svg");
    return new XMLSerializer().serializeToString(copy);
  }

  async png() {
    const { width, height } = this.drawn.getBoundingClientRect();
    const image = new Image();
    image.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(this.svg())}`;
    await image.decode();
    const canvas = make("canvas", { width: 2 * width, height: 2 * height });
    canvas.getContext("2d").drawImage(image, 0, 0, 2 * width, 2 * height);
    canvas.toBlob((blob) => save(`${this.name}.png`, blob));
  }

  data() {
    return csv([["series", this.x || "x", "value"], ...this.points.map((p) => [p.series, p.x, p.y])]);
  }
}
