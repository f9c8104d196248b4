"use strict";
// The player: graphs laid out beforehand, and frames that mark their nodes and edges.

const data = JSON.parse(document.getElementById("data").textContent);
const graphs = data.graphs ?? [], shows = data.shows ?? [], model = data.model;
const at = (id) => document.getElementById(id);
const PLAY_MS = 900;
const LEAST_SCALE = 0.55; // below it, labels are too small to read
const LARGEST_SCALE = 4 / 3; // the letters are as large as those of the page
const FILLED_SCALE = 1.6; // of a picture that has a frame for itself
const PART_SCALE = 0.85; // of a graph of which a part is seen

// ------------------------------------------------------------------------------- small helpers

function make(tag, text = "", attributes = {}) {
  const element = document.createElement(tag);
  element.textContent = text;
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  return element;
}

function number(x, digits = 4) {
  if (typeof x !== "number") return x ?? "";
  if (x === 0 || (Math.abs(x) >= 1e-3 && Math.abs(x) < 1e5)) return String(Number(x.toPrecision(digits)));
  return x.toExponential(2).replace("e+", "e");
}

function bounds(low, high) {
  if (high === undefined || high === null || number(high) === number(low)) return number(low);
  return `${number(low, 3)}…${number(high, 3)}`;
}

const many = (count, word) => `${count} ${word}${count === 1 ? "" : "s"}`;

// ---------------------------------------------------------------------------------------- panes

/** A graph with zoom and pan. Nodes are found by name, edges by their classes r5 (row) and t3. */
class Pane {
  constructor(index) {
    this.box = make("div", "", { class: "pane", tabindex: "0", role: "img" });
    this.box.innerHTML = graphs[index];
    this.svg = this.box.querySelector("svg");
    const [, , width, height] = this.svg.getAttribute("viewBox").split(/[ ,]+/).map(Number);
    this.size = { width, height };
    this.svg.removeAttribute("width");
    this.svg.removeAttribute("height");
    this.nodes = new Map();
    this.out = new Map(); // the edges that leave a node
    for (const group of this.svg.querySelectorAll("g.node, g.edge")) {
      const title = group.querySelector("title");
      const name = title.textContent;
      if (group.classList.contains("node")) this.nodes.set(name, group);
      else this.out.set(name.split("->")[0], [...(this.out.get(name.split("->")[0]) ?? []), group]);
      const spoken = [...group.querySelectorAll("text")].map((t) => t.textContent.trim()).join(", ");
      if (spoken) title.textContent = spoken;
      else title.remove();
    }
    this.svg.querySelector("g.graph > title")?.remove();
    this.view = null;
    this.touched = [];
    this.watch();
  }

  /** The whole graph if its labels can be read; otherwise a part, in letters that are read easily.
   * A pane reaches down to the end of the window, or takes a share of it if another one follows.
   * It is as high as the graph, but fills a frame that has nothing below it. */
  start(share = 1) {
    const { width, height } = this.size;
    const room = this.box.clientWidth || 600;
    const fills = share === 1 && data.embedded && document.querySelector("aside").hidden && !at("key").children.length;
    const above = share === 1 ? this.box.getBoundingClientRect().top + scrollY + (fills ? 10 : 60) : 0; // and the key
    const left = innerHeight * share - above;
    const most = Math.max(240, fills ? left : Math.min(left, height * LARGEST_SCALE + 8));
    const whole = Math.min(fills ? FILLED_SCALE : LARGEST_SCALE, room / width, most / height);
    this.scale = whole < LEAST_SCALE ? PART_SCALE : whole;
    this.box.style.height = `${fills ? most : Math.min(most, Math.max(height * this.scale, 90))}px`;
    const tall = this.box.clientHeight / this.scale, wide = room / this.scale;
    this.view = { x: (width - wide) / 2, y: tall > height ? (height - tall) / 2 : 0, wide, tall };
    this.draw();
  }

  fit() {
    const { width, height } = this.size;
    const scale = Math.min(this.box.clientWidth / width, this.box.clientHeight / height);
    const wide = this.box.clientWidth / scale, tall = this.box.clientHeight / scale;
    this.view = { x: (width - wide) / 2, y: (height - tall) / 2, wide, tall };
    this.draw();
  }

  draw() {
    const { x, y, wide, tall } = this.view;
    this.svg.setAttribute("viewBox", `${x} ${y} ${wide} ${tall}`);
  }

  /** Zoom by a factor about a point of the pane, given as shares of its width and height. */
  zoom(factor, u = 0.5, v = 0.5) {
    const { x, y, wide, tall } = this.view;
    const scale = this.box.clientWidth / wide;
    const by = Math.min(Math.max(factor, 0.02 / scale), 8 / scale);
    this.view = { x: x + u * wide * (1 - 1 / by), y: y + v * tall * (1 - 1 / by), wide: wide / by, tall: tall / by };
    this.draw();
  }

  /** Move the view if a node lies outside of it. */
  reveal(name) {
    const group = this.nodes.get(name);
    if (!group || !this.view) return;
    const box = group.getBBox(), shift = this.svg.querySelector("g.graph").transform.baseVal.consolidate().matrix;
    const x = box.x + box.width / 2 + shift.e, y = box.y + box.height / 2 + shift.f, view = this.view;
    const outside = (p, start, length) => p < start + 0.08 * length || p > start + 0.92 * length;
    if (outside(x, view.x, view.wide)) view.x = x - view.wide / 2;
    if (outside(y, view.y, view.tall)) view.y = y - view.tall / 2;
    this.keepInside();
    this.draw();
  }

  /** No empty border while a part of the graph is out of sight. */
  keepInside() {
    const { width, height } = this.size, view = this.view;
    const place = (start, length, whole) => (length >= whole ? (whole - length) / 2 : Math.min(Math.max(start, 0), whole - length));
    view.x = place(view.x, view.wide, width);
    view.y = place(view.y, view.tall, height);
  }

  watch() {
    let from = null;
    this.box.addEventListener("pointerdown", (event) => {
      if (event.pointerType === "mouse" && event.button !== 0) return;
      from = { x: event.clientX, y: event.clientY, view: { ...this.view } };
      this.box.setPointerCapture(event.pointerId);
    });
    this.box.addEventListener("pointermove", (event) => {
      if (!from) return;
      const scale = this.box.clientWidth / from.view.wide;
      this.view.x = from.view.x - (event.clientX - from.x) / scale;
      this.view.y = from.view.y - (event.clientY - from.y) / scale;
      this.draw();
    });
    for (const end of ["pointerup", "pointercancel"]) this.box.addEventListener(end, () => (from = null));
    this.box.addEventListener("wheel", (event) => {
      if (!event.ctrlKey && !event.metaKey) return; // the page scrolls
      event.preventDefault();
      const box = this.box.getBoundingClientRect();
      this.zoom(event.deltaY < 0 ? 1.2 : 1 / 1.2, (event.clientX - box.x) / box.width, (event.clientY - box.y) / box.height);
    }, { passive: false });
  }

  mark(group, name) {
    group.classList.add(name);
    this.touched.push([group, name]);
  }

  clear() {
    for (const [group, name] of this.touched) group.classList.remove(name);
    this.touched = [];
  }

  apply(frame, index) {
    this.clear();
    for (const [graph, name, names] of frame.marks ?? []) {
      if (graph !== index) continue;
      for (const node of names) {
        if (this.nodes.has(node)) this.mark(this.nodes.get(node), name);
        if (name === "dim") for (const edge of this.out.get(node) ?? []) this.mark(edge, name);
      }
    }
    if (index !== data.states) return;
    if (data.valued) this.values(frame);
    if (frame.rows) {
      const chosen = new Set(frame.rows.map((row) => `r${row}`));
      for (const edge of this.svg.querySelectorAll("g.edge")) {
        this.mark(edge, [...edge.classList].some((c) => chosen.has(c)) ? "chosen" : "other");
      }
    }
    for (const [row, target] of frame.taken ?? []) {
      for (const edge of this.svg.querySelectorAll(`g.edge.r${row}`)) {
        const goal = [...edge.classList].find((c) => /^t\d+$/.test(c));
        if (goal === undefined || goal === `t${target}`) this.mark(edge, "taken");
      }
    }
  }

  /** Write values into the states, and shade them: the largest finite value is darkest. */
  values(frame) {
    const low = frame.low ?? [], high = frame.high ?? [];
    const finite = low.concat(high).filter((x) => typeof x === "number").map(Math.abs);
    const most = Math.max(...finite, 0);
    model.ids.forEach((id, i) => {
      const group = this.nodes.get(`s${id}`);
      if (!group) return; // the simulator knows more states than are drawn
      const label = group.lastElementChild.tagName === "text" ? group.lastElementChild : [...group.querySelectorAll("text")].pop();
      label.textContent = bounds(low[i], high[i]);
      label.classList.add("value");
      const moved = label.textContent ? "" : "translateY(0.55em)"; // the name in the middle of the box
      for (const line of group.querySelectorAll("text")) if (line !== label) line.style.transform = moved;
      const shape = group.querySelector("ellipse, polygon, path");
      const middle = typeof low[i] === "number" ? (low[i] + (typeof high[i] === "number" ? high[i] : low[i])) / 2 : null;
      const share = middle === null || most === 0 ? 0 : Math.abs(middle) / most;
      shape.style.fill = share > 0 ? `hsl(${middle < 0 ? 20 : 212} 70% ${96 - 24 * share}%)` : "";
      const title = group.querySelector("title");
      if (title) title.textContent = `${model.states[i]}${low.length ? `: ${bounds(low[i], high[i])}` : ""}`;
    });
  }
}

const panes = new Map();
const pane = (index) => {
  if (!panes.has(index)) panes.set(index, new Pane(index));
  return panes.get(index);
};

// -------------------------------------------------------------------------------------- player

let show = shows[0], index = 0, timer = null, visible = [];

const frames = () => (show.play === "simulator" ? walk.frames : show.frames);

function select(chosen) {
  pause();
  show = shows[chosen];
  index = 0;
  at("show").value = String(chosen);
  at("note").textContent = [show.group, show.note].filter(Boolean).join(": ");
  at("simulator").hidden = show.play !== "simulator";
  if (show.play === "simulator" && !walk.frames.length) walk.restart();
  at("key").replaceChildren(
    ...(show.keys ?? []).map(([name, text]) => {
      const item = make("li", text);
      item.prepend(make("span", "", { class: `swatch ${name}` }));
      return item;
    }),
  );
  for (const button of document.querySelectorAll("#properties button")) {
    button.setAttribute("aria-pressed", String(button.dataset.show === String(chosen)));
  }
  render();
}

function render() {
  const all = frames(), frame = all[index], last = all.length - 1, endless = show.play === "simulator";
  at("player").hidden = last === 0 && !endless;
  at("slider").max = last;
  at("slider").value = index;
  at("slider").setAttribute("aria-valuetext", `frame ${index + 1} of ${last + 1}: ${frame.title}`);
  at("count").textContent = endless ? many(index, "step") : `${index + 1} / ${last + 1}`;
  for (const id of ["first", "back"]) at(id).disabled = index === 0;
  at("last").disabled = index === last;
  for (const id of ["forward", "play"]) at(id).disabled = index === last && !(endless && walk.moves());
  const lines = [make("strong", frame.title)];
  if (frame.note) lines.push(make("span", ` ${frame.note}`));
  at("caption").replaceChildren(...lines);
  at("caption").hidden = !frame.title && !frame.note;
  const wanted = frame.panes ?? show.panes ?? [];
  if (wanted.join() !== visible.join()) {
    visible = wanted;
    at("panes").replaceChildren(...wanted.map((i) => pane(i).box));
    arrange();
  }
  at("zoom").hidden = !wanted.length;
  for (const i of wanted) {
    pane(i).apply(frame, i);
    pane(i).box.setAttribute("aria-label", [frame.title ?? show.name, frame.note].filter(Boolean).join(". "));
    const [, , names] = (frame.marks ?? []).find(([g, name, nodes]) => g === i && nodes.length && /^(now|new)$/.test(name)) ?? [];
    if (names) pane(i).reveal(names[0]);
    else if (index === 0 && i === data.states) pane(i).reveal(`s${model.ids[model.initial[0]]}`);
  }
  if (endless) walk.offer();
}

/** Two graphs stand side by side if the first one is narrow enough. */
function arrange() {
  const beside = visible.length > 1 && pane(visible[0]).size.width * LEAST_SCALE < at("panes").clientWidth * 0.6;
  at("panes").classList.toggle("two", beside);
  for (const i of visible) pane(i).start(visible.length > 1 && !beside ? 0.42 : 1);
}

function go(to) {
  const last = frames().length - 1;
  index = Math.max(0, Math.min(to, last));
  render();
}

function forward() {
  if (index === frames().length - 1 && show.play === "simulator") walk.step();
  else go(index + 1);
}

function pause() {
  clearInterval(timer);
  timer = null;
  at("play").textContent = "Play";
}

function play() {
  if (timer) return pause();
  if (at("play").disabled) return undefined;
  at("play").textContent = "Pause";
  timer = setInterval(() => {
    forward();
    if (at("forward").disabled) pause();
  }, PLAY_MS);
  return forward();
}

// ------------------------------------------------------------------------------------ simulator

/** A walk through the model, one frame per state. */
const walk = {
  frames: [],
  path: [],

  strategy() {
    return model.strategies[Number(at("policy").value)]; // undefined for random choices
  },

  restart() {
    pause();
    this.path = [{ state: model.initial[0], time: 0, by: "start" }];
    this.frames = [];
    this.show();
  },

  /** The choices of the current state: [row, action, [[target, probability or rate, action], …]],
   * where a chain has the action of a transition and an MDP that of a choice. */
  choices() {
    return model.rows[this.path[index].state];
  },

  moves() {
    return this.choices().some(([, , successors]) => successors.some(([target]) => target >= 0));
  },

  take(choice, target) {
    const [row, action, successors] = choice;
    const here = this.path[index];
    const total = successors.reduce((sum, [, p]) => sum + p, 0);
    const stay = model.kind === "CTMC" ? -Math.log(1 - Math.random()) / total : 1;
    this.path = this.path.slice(0, index + 1);
    const by = action || successors.find(([to]) => to === target)?.[2];
    this.path.push({ state: target, time: here.time + stay, by, row });
    this.show();
  },

  step() {
    const strategy = this.strategy(), all = this.choices();
    const choice = strategy
      ? all.find(([row]) => row === strategy.rows[this.path[index].state])
      : all[Math.floor(Math.random() * all.length)];
    const inside = choice[2].filter(([target]) => target >= 0);
    if (!inside.length) return;
    let left = Math.random() * inside.reduce((sum, [, p]) => sum + p, 0);
    const [target] = inside.find(([, p]) => (left -= p) < 0) ?? inside[inside.length - 1];
    this.take(choice, target);
  },

  /** The labels of a state, its rewards that are not 0, and whether it is out of the picture. */
  about(state) {
    const named = (name) => (name ? `"${name}" ` : "");
    return [
      (model.labels?.[state] ?? []).map((label) => `"${label}"`).join(", "),
      ...(model.rewards ?? []).filter(([, values]) => values[state]).map(([name, values]) => `reward ${named(name)}${number(values[state])}`),
      pane(data.states).nodes.has(`s${model.ids[state]}`) ? "" : "not in the picture",
    ].filter(Boolean).join("; ");
  },

  /** Make the frames again, and go to the last one. */
  show() {
    const strategy = this.strategy(), seen = new Set();
    this.frames = this.path.map(({ state, time, by, row }, i) => {
      seen.add(`s${model.ids[state]}`);
      const when = model.kind === "CTMC" ? `, time ${number(time)}` : "";
      return {
        title: `Step ${i}${when}: ${model.states[state]}`,
        note: [i ? (by ? `by ${by}` : "") : "the initial state", this.about(state)].filter(Boolean).join("; "),
        panes: show.panes,
        marks: [[data.states, "now", [`s${model.ids[state]}`]], [data.states, "in", [...seen]]],
        rows: strategy?.rows,
        low: strategy?.values,
        taken: i ? [[row, model.ids[state]]] : [],
      };
    });
    index = this.path.length - 1;
    if (show.play === "simulator") render();
  },

  /** A button for each transition of the current state. */
  offer() {
    const buttons = this.choices().map((choice) => {
      const [row, action, successors] = choice;
      const group = make("span", "", { class: "choice" });
      if (action) group.append(make("em", action));
      for (const [target, p, by] of successors) {
        const to = target < 0 ? "states that are not shown" : model.states[target];
        const button = make("button", `${by ? `${by}: ` : ""}${number(p)} → ${to}`, { type: "button", "data-row": row });
        button.disabled = target < 0;
        button.addEventListener("click", () => {
          pause();
          this.take(choice, target);
        });
        group.append(button);
      }
      return group;
    });
    at("steps").replaceChildren(...buttons);
    at("step").disabled = !this.moves();
  },
};

// ---------------------------------------------------------------------------------------- page

function fill() {
  at("title").textContent = data.title ?? "";
  document.querySelector("header").hidden = Boolean(data.embedded);
  document.body.classList.toggle("embedded", Boolean(data.embedded));
  for (const [name, value] of data.facts ?? []) at("facts").append(make("dt", name), make("dd", value));
  at("text").textContent = data.text ?? "";
  at("text-part").hidden = !data.text;
  at("properties-part").hidden = !data.properties?.length;
  document.querySelector("aside").hidden = !data.text && !data.properties?.length;
  for (const { text, value, detail, show: shown } of data.properties ?? []) {
    const item = make("li");
    if (shown === null || shown === undefined) item.append(make("code", text));
    else {
      const button = make("button", text, { type: "button", "data-show": shown, title: "Show the values of the states" });
      button.addEventListener("click", () => select(shown));
      item.append(button);
    }
    item.append(make("strong", value), make("small", detail));
    at("properties").append(item);
  }
  const groups = new Map();
  shows.forEach(({ name, group = "" }, i) => {
    if (group && !groups.has(group)) {
      groups.set(group, make("optgroup", "", { label: group }));
      at("show").append(groups.get(group));
    }
    (groups.get(group) ?? at("show")).append(make("option", name, { value: i }));
  });
  at("show").closest(".bar").hidden = shows.length < 2 && !graphs.length;
  at("show").hidden = document.querySelector('label[for="show"]').hidden = shows.length < 2;
  at("policy").append(make("option", "at random", { value: "-1" }));
  (model?.strategies ?? []).forEach(({ name }, i) => at("policy").append(make("option", `strategy of ${name}`, { value: i })));
}

function listen() {
  const paused = (action) => () => {
    pause();
    action();
  };
  at("show").addEventListener("change", () => select(Number(at("show").value)));
  at("first").addEventListener("click", paused(() => go(0)));
  at("back").addEventListener("click", paused(() => go(index - 1)));
  at("play").addEventListener("click", play);
  at("forward").addEventListener("click", paused(forward));
  at("last").addEventListener("click", paused(() => go(Infinity)));
  at("slider").addEventListener("input", paused(() => go(Number(at("slider").value))));
  at("step").addEventListener("click", paused(() => walk.step()));
  at("restart").addEventListener("click", () => walk.restart());
  at("policy").addEventListener("change", () => walk.show());
  const each = (action) => () => visible.forEach((i) => action(pane(i)));
  at("larger").addEventListener("click", each((p) => p.zoom(1.3)));
  at("smaller").addEventListener("click", each((p) => p.zoom(1 / 1.3)));
  at("fit").addEventListener("click", each((p) => p.fit()));
  let width = innerWidth;
  addEventListener("resize", () => {
    const bar = innerWidth === width && matchMedia("(pointer: coarse)").matches; // a phone's, which comes and goes
    width = innerWidth;
    if (!visible.length || bar) return;
    arrange();
    render();
  });
  addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const tag = event.target.tagName;
    if ((tag === "BUTTON" && event.key === " ") || (tag === "INPUT" && event.key !== " ")) return;
    const action = {
      ArrowRight: paused(forward), ArrowLeft: paused(() => go(index - 1)),
      Home: paused(() => go(0)), End: paused(() => go(Infinity)), " ": play,
    }[event.key]; // a list keeps the other keys
    if (!action || at("player").hidden) return;
    event.preventDefault();
    action();
  });
}

fill();
listen();
// page.html#3.2 opens the third entry of the list at its second frame.
const [wanted, frame] = location.hash.slice(1).split(".").map((text) => Number(text) || 1);
const listed = [...at("show").options];
if (listed.length) select(Number(listed[Math.min(wanted, listed.length) - 1].value));
if (frame > 1 && show.play !== "simulator") go(frame - 1);
