// The workbench: two texts, and what is computed from them.
import { at, button, csv, make, option, save, tabs } from "./dom.js";
import { Editor } from "./editor.js";
import { Chart } from "./plot.js";
import { ask, run } from "./server.js";

const PARTS = ["model", "properties"];
const project = ask("project");
const files = { model: { name: "", version: "", saved: "" }, properties: { name: "", version: "", saved: "" } };
const values = {}; // of constants, as texts
const ranges = {};
const options = {};
const results = new Map(); // by the text of a property
let list = [], constants = [], ofModel = [], known = {}, seenFaults = [];

// ------------------------------------------------------------------------------------------- log

function log(text, kind = "") {
  at("log-lines").append(make("li", { class: kind }, `${new Date().toTimeString().slice(0, 8)} ${text}`));
  while (at("log-lines").children.length > 500) at("log-lines").firstChild.remove();
}

function tell(text, bad = false) {
  at("state").textContent = text.split("\n")[0];
  at("state").title = text;
  at("state").classList.toggle("bad", bad);
}

/** Tell that something went wrong: below the tabs in full, unless it stands elsewhere already. */
function fail(error, what, isShown = false) {
  if (error.name === "AbortError") return log(`${what}: cancelled`);
  log(`${what}: ${error.message}`, "bad");
  if (!isShown) trouble(what, error.message);
  if (error.faults) for (const part of PARTS) if (error.faults[part].length) editors[part].show(error.faults[part]);
}

function trouble(what = "", text = "") {
  at("trouble").hidden = !text;
  if (text) at("trouble").replaceChildren(button("✕", () => trouble(), { "aria-label": "Close", title: "Close" }), make("strong", {}, `${what}: `), make("pre", {}, text));
}

// ----------------------------------------------------------------------------------------- texts

const texts = () => ({
  model: editors.model.text, properties: editors.properties.text,
  model_name: files.model.name || "model", properties_name: files.properties.name || "properties",
});

const editors = Object.fromEntries(PARTS.map((part) => [part, new Editor(at(part), part === "model" ? "Model" : "Properties", {
  changed: () => changed(part),
  save: saveAll,
  hover: async (place) => (await ask("hover", { ...texts(), part, at: place }).catch(() => ({}))).text,
  completions: async (place) => (await ask("completions", { ...texts(), part, at: place }).catch(() => ({ items: [] }))).items,
})]));

const draftKey = (part) => `draft ${part} ${known.folder}/${files[part].name}`;
const isDirty = (part) => editors[part].text !== files[part].saved;

function marks() {
  for (const part of PARTS) {
    const dirty = isDirty(part);
    at(`${part}-tab`).textContent = `${dirty ? "● " : ""}${files[part].name || part}`;
    at(`${part}-tab`).title = dirty ? "not saved" : "";
  }
  at("save").disabled = !PARTS.some(isDirty);
}

function changed(part) {
  marks();
  const { version } = files[part];
  if (isDirty(part)) localStorage.setItem(draftKey(part), JSON.stringify({ text: editors[part].text, version }));
  else localStorage.removeItem(draftKey(part));
  later();
}

async function open(part, name) {
  try {
    const { text, version } = name ? await ask("read", { name }) : { text: "", version: "" };
    files[part] = { name, version, saved: text };
    noConflict(part);
    if (part === "model") at("facts").replaceChildren(), warn([]);
    const draft = JSON.parse(localStorage.getItem(draftKey(part)) ?? "null");
    editors[part].open(draft ? draft.text : text);
    if (draft && draft.version !== version) {
      files[part].version = draft.version; // saving does not overwrite the newer file
      conflict(part, text, version);
    }
    log(draft ? `${name}: unsaved changes of the last visit are there again` : `opened ${name || "an empty text"}`);
  } catch (error) {
    fail(error, `opening ${name}`);
  }
  choose(part);
  marks();
  later();
  address();
}

/** The address names the files, so that they are open again after a reload. */
function address() {
  history.replaceState(null, "", `#${encodeURIComponent(files.model.name)},${encodeURIComponent(files.properties.name)}`);
}

async function openModel(name) {
  await open("model", name);
  const stem = (name) => name.replace(/\.\w+$/, "");
  const own = known.files.properties.find((name) => stem(name) === stem(files.model.name));
  if (own && own !== files.properties.name && !isDirty("properties")) await open("properties", own);
}

async function saveAll() {
  for (const part of PARTS.filter(isDirty)) {
    const file = files[part], text = editors[part].text;
    if (!file.name) {
      const name = prompt(`A name for the ${part}:`, part === "model" ? "model.prism" : "model.props");
      if (!name) continue;
      localStorage.removeItem(draftKey(part));
      file.name = name;
    }
    try {
      const { version } = await ask("write", { name: file.name, text, version: file.version });
      localStorage.removeItem(draftKey(part));
      Object.assign(file, { version, saved: text });
      log(`saved ${file.name}`);
    } catch (error) {
      fail(error, `saving ${file.name}`);
      if (error.newer) await outside();
      else if (!file.version) file.name = "";
    }
  }
  try {
    known = await ask("project");
  } catch (error) {
    return fail(error, "saving");
  }
  PARTS.forEach(choose);
  marks();
  address();
}

const conflictOf = (part) => at("conflict").querySelector(`[data-part=${part}]`);

/** Ask which text stays. A question that is there already stays as it is, and so does the focus. */
function conflict(part, text, version) {
  const file = files[part], before = conflictOf(part);
  if (before?.dataset.version === version) return;
  const settled = (take) => {
    Object.assign(file, { version, saved: text });
    if (take) editors[part].replace(text);
    noConflict(part);
    changed(part);
  };
  before?.remove();
  at("conflict").append(make("p", { "data-part": part, "data-version": version }, `${file.name} has changed on disk, and here. `,
    button("Take the file", () => settled(true)), " ", button("Keep mine", () => settled(false))));
  at("conflict").hidden = false;
}

function noConflict(part) {
  conflictOf(part)?.remove();
  at("conflict").hidden = !at("conflict").children.length;
}

/** Look for changes that others have made. */
async function outside() {
  const open = PARTS.filter((part) => files[part].name);
  const found = await ask("versions", { names: open.map((part) => files[part].name) });
  if (JSON.stringify(found.files) !== JSON.stringify(known.files)) {
    known.files = found.files;
    PARTS.forEach(choose);
  }
  for (const part of open) {
    const file = files[part], version = found.versions[file.name];
    if (version === undefined || version === file.version) {
      noConflict(part);
      continue;
    }
    const { text } = await ask("read", { name: file.name });
    if (files[part] !== file || file.version === version) continue; // opened or settled meanwhile
    const same = text === editors[part].text;
    if (!same && isDirty(part)) conflict(part, text, version);
    else {
      Object.assign(file, { version, saved: text });
      noConflict(part);
      if (!same) editors[part].replace(text), log(`${file.name} was changed outside, and read again`);
    }
    marks();
  }
}

function choose(part) {
  const select = at(`${part}-file`), names = known.files[part], { name } = files[part];
  const all = name && !names.includes(name) ? [name, ...names] : names;
  select.replaceChildren(option("", part === "model" ? "(new model)" : "(new properties)"), ...all.map((n) => option(n)));
  select.value = name;
}

// -------------------------------------------------------------------------------------- analysis

let timer = null, analysed = 0, exploring = null;

function later() {
  clearTimeout(timer);
  exploring?.abort();
  timer = setTimeout(analyse, 120);
}

async function analyse() {
  const number = ++analysed, now = texts();
  let found;
  try {
    found = await ask("analysis", now);
  } catch (error) {
    return fail(error, "analysis");
  }
  if (number !== analysed || now.model !== editors.model.text || now.properties !== editors.properties.text) return;
  for (const part of PARTS) editors[part].show(found[part].faults, found[part].colours);
  const faults = PARTS.flatMap((part) => found[part].faults.map((f) => ({ ...f, part })));
  seenFaults = found.model.faults;
  if (found.list) list = found.list;
  constants = found.constants ?? constants; // the fields stay while a text is faulty
  ofModel = found.of_model ?? ofModel;
  showConstants();
  showList();
  const errors = faults.filter((f) => f.severity === "error").length;
  tell(faults.length ? `${faults[0].part}: ${faults[0].message}` : "", errors > 0);
  if (!errors && now.model.trim() && ofModel.every((name) => values[name])) timer = setTimeout(explore, 500);
}

/** Faults that only the states show. */
async function explore() {
  exploring = new AbortController();
  try {
    const { states, faults, about } = await run("explore", { do: "explore", ...job() }, { signal: exploring.signal });
    if (faults.length) editors.model.show([...seenFaults, ...faults]);
    tell([`${states.toLocaleString("en")} reachable states`, about].filter(Boolean).join("; "));
  } catch (error) {
    if (error.faults?.model.length) {
      editors.model.show(error.faults.model);
      tell(error.faults.model[0].message, true);
    }
  }
}

function showConstants() {
  for (const [box, store, hint] of [["constants", values, "value"], ["ranges", ranges, "1:10"]]) {
    const shown = [...at(box).querySelectorAll("input")].map((i) => i.name).join();
    if (shown === constants.map((c) => c.name).join()) continue;
    at(box).replaceChildren(...constants.map((c) => make("label", {}, `${c.name} (${c.type}) `,
      make("input", { name: c.name, size: 9, value: store[c.name] ?? "", placeholder: hint, autocomplete: "off", input: (e) => {
        store[c.name] = e.target.value.trim();
        sessionStorage.setItem(box, JSON.stringify(store));
        if (box === "constants") later();
      } }))));
  }
}

// ------------------------------------------------------------------------------------------ jobs

const job = () => ({ ...texts(), constants: { ...values }, options: { ...options } });

const lanes = {}; // a worker does one job at a time: the jobs that wait, and the one that runs

/** Whether each of these constants has a value; if not, its field gets the focus. */
function complete(needed) {
  const open = needed.find((name) => !values[name]);
  if (!open) return true;
  trouble("constants", `${open} has no value: write one into its field`);
  showTool("check");
  at("constants").querySelector(`[name="${open}"]`)?.focus();
  return false;
}

/** Do a job that needs a value of each constant of the model, or that a property needs. */
function queue(worker, asked, what, needed = ofModel) {
  return complete(needed) ? enqueue(worker, asked, what) : Promise.resolve({ error: { name: "AbortError" }, incomplete: true });
}

/** Do a job after those that wait for the same worker. Its progress and a button are on the page. */
function enqueue(worker, asked, what, told) {
  trouble();
  const lane = (lanes[worker] ??= { worker, waiting: [], running: null });
  return new Promise((resolve) => {
    lane.waiting.push({ asked, what, told, resolve });
    if (!lane.running) next(lane);
  });
}

async function next(lane) {
  const todo = lane.waiting.shift();
  if (!todo) return;
  const { what } = todo, started = performance.now();
  const doing = make("output", {}, what);
  const row = make("div", { class: "bar" }, make("span", { class: "spinner", "aria-hidden": "true" }), doing, button("Cancel", () => cancel(lane), { title: "End it (Esc)" }));
  lane.running = new AbortController();
  at("progress").append(row);
  let step = "";
  const told = (message) => {
    step = message.progress ? `: ${message.progress}` : step;
    const more = lane.waiting.length ? `, ${lane.waiting.length} more wait` : "";
    doing.textContent = `${what}${step} (${((performance.now() - started) / 1000).toFixed(1)} s${more})`;
    todo.told?.(message);
  };
  const asked = todo.asked();
  let found;
  try {
    found = await run(lane.worker, asked, { told, signal: lane.running.signal });
  } catch (error) {
    fail(error, what, asked.do === "check");
    found = { error };
  }
  lane.running = null;
  row.remove();
  todo.resolve(found);
  next(lane);
}

function cancel(lane) {
  for (const { resolve, what } of lane.waiting.splice(0)) {
    log(`${what}: cancelled`);
    resolve({ error: { name: "AbortError", message: "cancelled" } });
  }
  lane.running?.abort();
}

// ----------------------------------------------------------------------------------------- check

const nameOf = (p) => p.name || p.text;
const keyOf = (p) => `${p.name}:${p.text}`;

const shownIn = new WeakMap();

/** What a box shows, made anew only if it changes: buttons stay where they are pressed. The focus
 * stays at its place. */
function show(box, what, children) {
  const now = JSON.stringify(what);
  if (shownIn.get(box) === now) return;
  shownIn.set(box, now);
  const place = (element) => [...box.querySelectorAll("button")].indexOf(element);
  const before = place(document.activeElement);
  box.replaceChildren(...children());
  if (before >= 0) [...box.querySelectorAll("button")].slice(0, before + 1).at(-1)?.focus();
}

function showList() {
  const now = JSON.stringify(job());
  const seen = list.map((p) => ({ ...results.get(keyOf(p)) })).map(({ of, ...seen }) => ({ ...seen, isOld: of !== undefined && of !== now }));
  forget();
  at("no-properties").hidden = list.length > 0;
  show(at("list"), [list, seen], () => list.map((p, number) => listed(p, number, seen[number])));
  for (const id of ["experiment-property", "sim-property"]) {
    const all = [...(id === "experiment-property" ? [["", "all"]] : []), ...list.map((p, i) => [i, nameOf(p)])];
    const before = at(id).value;
    show(at(id), all, () => all.map((one) => option(...one)));
    if ([...at(id).options].some((o) => o.value === before)) at(id).value = before;
  }
}

/** The item of a property: its text, and its result if it was checked. */
function listed(p, number, { result, error, isOld }) {
  const item = make("li", { class: isOld ? "old" : "" }, button(p.name ? `"${p.name}": ${p.text}` : p.text, () => { showText("properties"); editors.properties.go(p.at); }, { class: "link mono", title: "Go to the text" }), make("br"),
    button("Check", () => check(number), { "aria-label": `Check ${nameOf(p)}` }));
  if (result) {
    const mark = result.holds === null ? "" : result.holds ? "✓ " : "✗ ";
    item.append(" ", make("span", { class: `value ${result.holds === null ? "" : result.holds ? "good" : "bad"}` }, mark + result.value),
      make("span", { class: "of" }, [isOld ? "before the last changes" : "", result.accuracy, result.bounds, result.about, `${result.seconds.toFixed(3)} s`].filter(Boolean).join("; ")),
      " ", result.holds === null ? "" : button("Why?", () => explain("explain", number), { title: "Counterexample or witness" }),
      result.chooses ? button("Strategy", () => explain("strategy", number)) : "",
      result.lines.length ? make("pre", {}, result.lines.join("\n")) : "");
  } else if (error) item.append(" ", make("pre", { class: "of bad" }, error));
  return item;
}

async function check(number) {
  const property = list[number];
  let of = "";
  const asked = () => {
    of = JSON.stringify(job());
    return { do: "check", ...job(), property: property.text };
  };
  const found = await queue("check", asked, nameOf(property), property.constants);
  if (found.incomplete) return;
  results.set(keyOf(property), found.error ? { error: found.error.name === "AbortError" ? "cancelled" : found.error.message, of } : { result: found, of });
  if (!found.error) warn(found.warnings);
  if (!found.error) log(`${nameOf(property)}: ${found.value} (${found.accuracy}), ${found.seconds.toFixed(3)} s`);
  showList();
}

/** The warnings of a model, beside its results. */
function warn(warnings) {
  show(at("warnings"), warnings, () => warnings.map((text) => make("li", {}, text)));
}

let factsOf = "";
const stateOf = () => JSON.stringify([editors.model.text, values, options]);

/** Facts of another text or of other values are no longer those of the model. */
function forget() {
  if (factsOf && factsOf !== stateOf()) factsOf = "", at("facts").replaceChildren(), warn([]);
}

async function build() {
  let of = "";
  const asked = () => {
    of = stateOf();
    return { do: "build", ...job() };
  };
  const found = await queue("check", asked, "building the model");
  if (found.error) return;
  factsOf = of;
  at("facts").replaceChildren(...found.facts.flatMap(([name, text]) => [make("dt", {}, name), make("dd", {}, text)]));
  warn(found.warnings);
  log(`built: ${found.facts.map((f) => f.join(" ")).join(", ")}, ${found.seconds.toFixed(3)} s`);
}

async function explain(what, number) {
  const found = await queue("check", () => ({ do: what, ...job(), property: list[number].text }), `${what === "explain" ? "explaining" : "strategy of"} ${nameOf(list[number])}`, list[number].constants);
  if (found.error) return;
  log(found.text);
  draw(found);
}

// ------------------------------------------------------------------------------------ experiment

let series = [], rows = [];
const chart = new Chart(at("experiment-chart"), "experiment");

async function experiment() {
  const property = list[at("experiment-property").value]?.text ?? null;
  if (!at("keep").checked) series = [];
  const mine = { rows: [], run: series.length + 1 };
  series.push(mine);
  const given = Object.fromEntries(constants.map((c) => [c.name, ranges[c.name] || values[c.name] || ""]));
  const found = await enqueue("check", () => ({ do: "experiment", ...job(), constants: given, property }), "experiment", (message) => {
    if (message.rows) mine.rows.push(...message.rows), plot();
  });
  if (found.error) return;
  mine.csv = found.csv;
  log(`experiment: ${mine.rows.length} results`);
  plot();
}

function plot() {
  rows = series.flatMap((s) => s.rows);
  const names = [...new Set(rows.flatMap((r) => Object.keys(r.constants)))];
  const varying = names.filter((n) => new Set(rows.map((r) => r.constants[n])).size > 1);
  const before = at("axis").value;
  at("axis").replaceChildren(...(varying.length ? varying : names).map((n) => option(n)));
  if (varying.includes(before)) at("axis").value = before;
  const x = at("axis").value;
  const several = new Set(rows.map((r) => r.property)).size > 1;
  const points = series.flatMap((s) => s.rows.filter((r) => r.numbers[0] !== null && x in r.constants).map((r) => ({
    x: Number.isNaN(Number(r.constants[x])) ? r.constants[x] : Number(r.constants[x]), y: r.numbers[0], low: r.numbers[1], high: r.numbers[2],
    series: [several || varying.length < 2 || series.length > 1 ? r.property : "", ...varying.filter((n) => n !== x).map((n) => `${n}=${r.constants[n]}`), series.length > 1 ? `run ${s.run}` : ""].filter(Boolean).join(", "),
  })));
  points.sort((a, b) => a.x - b.x);
  const head = ["property", ...names, "value", "accuracy"];
  chart.show(points, x, several ? "value" : rows[0]?.property ?? "", series.length === 1 ? series[0].csv : csv([head, ...rows.map((r) => [r.property, ...names.map((n) => r.constants[n] ?? ""), r.text, r.accuracy])]));
  at("experiment-table").replaceChildren(make("tr", {}, ...head.map((h) => make("th", { class: h === "property" || h === "accuracy" ? "left" : "" }, h))),
    ...rows.slice(-500).map((r) => make("tr", {}, make("td", { class: "left" }, r.property), ...names.map((n) => make("td", {}, r.constants[n] ?? "")), make("td", {}, r.text), make("td", { class: "left" }, r.accuracy))));
}

// ------------------------------------------------------------------------------------- simulator

const SHOWN = 300;
let path = [], sim = null, shownVariables = new Set();
const pathChart = new Chart(at("sim-chart"), "path", { steps: true });

async function move(asked, what) {
  const found = await queue("simulate", () => ({ ...job(), ...asked }), what);
  if (found.error) return;
  path = path.slice(0, found.length - found.rows.length).concat(found.rows);
  if (asked.do === "start") at("sim-seed").placeholder = found.seed, log(`new path, seed ${found.seed}`), (shownVariables = new Set(found.variables.slice(0, 3)));
  sim = found;
  showPath();
}

const step = (more) => move({ do: "move", ...more }, "simulator");
const number = (text) => (/^\d+$/.test(text) ? Number(text) : 1);

function showPath() {
  const { variables, rewards, labels, totals, choices, length } = sim;
  for (const id of ["sim-step", "sim-run", "sim-follow"]) at(id).disabled = !choices.length || (id === "sim-follow" && !list.length);
  at("sim-back").disabled = at("sim-reset").disabled = length < 2;
  const earned = Object.entries(totals).map(([n, x]) => `${n} so far ${Number(x.toPrecision(6))}`);
  at("sim-state").replaceChildren(make("strong", {}, `Step ${length - 1}: `), [sim.state.replaceAll(" & ", ", "), labels.length ? `labels ${labels.join(", ")}` : "", ...earned, choices.length ? "" : "a deadlock"].filter(Boolean).join("; "));
  show(at("sim-choices"), choices, () => choices.map((c, i) => make("li", {}, make("code", {}, `${c.module ? `${c.module}: ` : ""}${c.text}`),
    ...c.branches.map(([weight, change], j) => button(`${weight}: ${change}`, () => step({ move: "step", choice: i, branch: j }))))));
  const cells = ([transition, time, state, reward, earned], i) => [i, transition, Number(time.toPrecision(6)), ...state.map(String), ...reward, ...(earned.length ? earned : reward.map(() => ""))];
  const head = ["step", "transition", "time", ...variables, ...rewards.map((r) => `${r} (state)`), ...rewards.map((r) => `${r} (transition)`)];
  const from = Math.max(0, path.length - SHOWN);
  at("sim-path").replaceChildren(make("tr", {}, ...head.map((h) => make("th", {}, h))), ...(from ? [make("tr", {}, make("td", { class: "left", colspan: head.length }, `${from} earlier steps are in the CSV file and in the plot`))] : []),
    ...path.slice(from).map((row, i) => make("tr", { class: from + i === path.length - 1 ? "now" : "" }, ...cells(row, from + i).map((x) => make("td", {}, String(x))))));
  at("sim-path").parentElement.scrollTop = 1e9;
  const numbers = (row, name) => [...row[2], ...row[3]][[...variables, ...rewards].indexOf(name)];
  at("sim-variables").replaceChildren(...[...variables, ...rewards].map((name) => make("label", {}, make("input", { type: "checkbox", checked: shownVariables.has(name), change: (e) => {
    e.target.checked ? shownVariables.add(name) : shownVariables.delete(name);
    showPath();
  } }), ` ${name}`)));
  const table = () => csv([head, ...path.map(cells)]);
  at("sim-csv").onclick = () => save("path.csv", table(), "text/csv");
  pathChart.show([...shownVariables].flatMap((name) => path.map((row) => ({ x: row[1], y: Number(numbers(row, name)), series: name }))), "time", "value");
}

// ----------------------------------------------------------------------------------------- graph

function draw({ text, page }) {
  at("graph-text").textContent = text ?? "";
  at("graph-text").hidden = !text;
  showTool("graph");
  const frame = at("drawn").cloneNode(); // a new one: Chromium leaves one blank that was out of sight
  frame.hidden = !page;
  if (page) frame.src = page;
  at("drawn").replaceWith(frame);
}

async function drawModel() {
  const found = await queue("draw", () => ({ do: "page", ...job(), states: Math.max(1, number(at("draw-states").value)) }), "drawing");
  if (!found.error) draw(found);
}

async function drawNear(around) {
  const found = await queue("draw", () => ({ do: "graph", ...job(), around }), "drawing");
  if (!found.error) draw(found);
}

// ----------------------------------------------------------------------------------------- start

async function exported(kind) {
  const found = await queue("draw", () => ({ do: "export", ...job(), kind }), `export of .${kind}`);
  if (found.error) return;
  const base = files.model.name.replace(/\.\w+$/, "") || "model";
  for (const [name, text] of Object.entries(found.files)) save(name.replace(/^model/, base), text);
  log(`exported ${Object.keys(found.files).length} file(s) of kind .${kind}`);
}

function exportResults() {
  const seen = list.map((p) => [p, results.get(keyOf(p))?.result]).filter(([, r]) => r);
  save("results.csv", csv([["property", "value", "accuracy", "bounds", "seconds"], ...seen.map(([p, r]) => [nameOf(p), r.value, r.accuracy, r.bounds, r.seconds])]), "text/csv");
}

const showText = tabs(at("text-tabs"));
const showTool = tabs(at("tool-tabs"), (id) => id === "experiment" && chart.draw());

at("properties-file").addEventListener("change", (e) => open("properties", e.target.value));
at("model-file").addEventListener("change", (e) => openModel(e.target.value));
const clicks = {
  save: saveAll, build, "check-all": () => list.forEach((_, i) => check(i)), "experiment-run": experiment,
  "sim-start": () => move({ do: "start", seed: at("sim-seed").value }, "new path"), "sim-step": () => step({ move: "step" }),
  "sim-run": () => step({ move: "run", steps: number(at("sim-steps").value) }), "sim-back": () => step({ move: "back", steps: 1 }), "sim-reset": () => step({ move: "restart" }),
  "sim-follow": () => step({ move: "follow", steps: number(at("sim-steps").value), property: list[at("sim-property").value]?.text }),
  "sim-graph": () => sim && drawNear(sim.state), draw: drawModel, "draw-near": () => drawNear(at("around").value),
  "export-results": exportResults, "log-clear": () => at("log-lines").replaceChildren(),
};
for (const [id, does] of Object.entries(clicks)) at(id).addEventListener("click", does);
for (const id of ["sim-step", "sim-run", "sim-follow", "sim-back", "sim-reset"]) at(id).disabled = true;
at("axis").addEventListener("change", plot);
at("around").addEventListener("keydown", (e) => e.key === "Enter" && drawNear(at("around").value));
at("sim-plot").addEventListener("toggle", () => pathChart.draw());
addEventListener("keydown", (e) => {
  if (e.key !== "s" || !(e.ctrlKey || e.metaKey) || e.defaultPrevented) return;
  e.preventDefault();
  saveAll();
});
addEventListener("keydown", (e) => e.key === "Escape" && !e.defaultPrevented && Object.values(lanes).forEach(cancel));
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => (chart.draw(), pathChart.draw()));
setInterval(() => document.hidden || outside().catch((error) => tell(error.message, true)), 2000);

project.then(async (found) => {
  known = found;
  at("folder").textContent = found.folder;
  at("folder").title = `symcheck ${found.version}`;
  Object.assign(values, JSON.parse(sessionStorage.getItem("constants") ?? "{}"));
  Object.assign(ranges, JSON.parse(sessionStorage.getItem("ranges") ?? "{}"));
  at("exports").replaceChildren(...found.exports.map((kind) => button(`.${kind}`, () => exported(kind))));
  at("option-fields").replaceChildren(...found.options.map((o) => {
    const set = (e) => { e.target.value === String(o.default) || e.target.value === "" ? delete options[o.name] : (options[o.name] = e.target.value); later(); };
    const field = o.names.length ? make("select", { change: set }, ...o.names.map((n) => option(n, n || "default"))) : make("input", { size: 8, change: set, placeholder: "default" });
    field.value = String(o.default);
    return make("label", { title: o.about }, `${o.name} `, field);
  }));
  const [model, properties] = location.hash.slice(1).split(",").map(decodeURIComponent);
  const { start } = found;
  if (location.hash) {
    await open("model", model ?? "");
    await open("properties", properties ?? "");
  } else {
    await (start.properties ? open("model", start.model ?? "") : openModel(start.model ?? ""));
    if (!files.properties.name) await open("properties", start.properties ?? "");
  }
}).catch((error) => fail(error, "start"));
