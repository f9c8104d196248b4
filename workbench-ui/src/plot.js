// A plot that is zoomed by dragging or by buttons, and saved.
import * as Plot from "@observablehq/plot";
import { button, csv, make, save } from "./dom.js";

/** Lines of points {x, y, low, high, series}; `steps`: a line keeps its value until the next point. */
export class Chart {
  constructor(box, name, { steps = false } = {}) {
    Object.assign(this, { name, steps, points: [], zoomed: null, x: "", y: "" });
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
    this.drawn = Plot.plot({
      width, height: Math.max(220, Math.min(340, width * 0.6)) + 14 * Math.max(series.length - 3, 0), marginRight: 24, marginLeft: 56, marginTop: 30 + 14 * series.length,
      style: { background: style.getPropertyValue("--back"), color: style.color, fontFamily: "system-ui, sans-serif" },
      x: { label: this.x, type: numeric ? "linear" : "point", ...(this.zoomed && numeric ? { domain: this.zoomed.x } : {}) },
      y: { label: this.y, grid: true, ...(this.zoomed ? { domain: this.zoomed.y } : {}) },
      color: { domain: series, ...(series.length > 10 ? { range: series.map((_, i) => `hsl(${Math.round((360 * i) / series.length)} 65% 50%)`) } : { scheme: "observable10" }) },
      marks: points.length ? [
        Plot.ruleX(bounded, { x: "x", y1: "low", y2: "high", z: null, stroke: "series", strokeOpacity: 0.6, clip: true }),
        Plot.lineY(points, { x: "x", y: "y", z: "series", stroke: "series", curve: steps ? "step-after" : "linear", clip: true }),
        Plot.dot(points.length > 300 ? [] : points, { x: "x", y: "y", z: null, fill: "series", r: 2.5, clip: true }),
        Plot.tip(points, Plot.pointer({ x: "x", y: "y", z: null, stroke: "series", fill: style.getPropertyValue("--back") })),
      ] : [],
    });
    series.forEach((name, i) => {
      const text = document.createElementNS("http://www.w3.org/2000/svg", "text");
      text.textContent = `● ${name.length > 70 ? `${name.slice(0, 69)}…` : name}`;
      for (const [key, value] of Object.entries({ x: 56, y: 12 + 14 * i, "text-anchor": "start", fill: this.drawn.scale("color").apply(name) })) text.setAttribute(key, value);
      this.drawn.append(text);
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
