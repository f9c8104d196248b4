// The workbench: two texts, and what is computed from them.
import { distributions } from "./distribution.js";
import { at, button, csv, make, option, save, tabs, whole } from "./dom.js";
import { Editor } from "./editor.js";
import { experiments } from "./experiment.js";
import { optionFields } from "./options.js";
import { ask, run } from "./server.js";
import { simulator } from "./simulator.js";

const PARTS = ["model", "properties"];
const project = ask("project");
const files = { model: { name: "", version: "", saved: "" }, properties: { name: "", version: "", saved: "" } };
const values = {}; // of constants, as texts
const ranges = {};
const options = {};
const results = new Map(); // by how a property is answered, its name and its text
let list = [], constants = [], ofModel = [], timed = false, known = {}, seenFaults = [];

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

/** Tell that something went wrong: below the tabs in full, unless it stands elsewhere already.
 * of: the texts and values that it is about. */
function fail(error, what, isShown = false, of = "") {
  if (error.name === "AbortError") return log(`${what}: cancelled`);
  log(`${what}: ${error.message}`, "bad");
  if (!isShown) trouble(what, error.message, of);
  const isOld = of && of !== JSON.stringify(job());
  if (error.faults && !isOld) for (const part of PARTS) if (error.faults[part].length) editors[part].show(error.faults[part]);
}

let troubleOf = ""; // when this has changed, the message is gone

function trouble(what = "", text = "", of = "") {
  troubleOf = of;
  at("trouble").hidden = !text;
  if (text) at("trouble").replaceChildren(button("✕", () => trouble(), { "aria-label": "Close", title: "Close" }), make("strong", {}, `${what}: `), make("pre", {}, text));
}

// ----------------------------------------------------------------------------------------- texts

const texts = () => ({
  model: editors.model.text, properties: editors.properties.text,
  model_name: files.model.name || "model", properties_name: files.properties.name || "properties",
});

const BEGINNINGS = {
  model: "dtmc\n\nmodule coin\n  side : [0..2] init 0;\n  [] side=0 -> 0.5 : (side'=1) + 0.5 : (side'=2);\nendmodule\n",
  properties: "// the probability that the coin shows 1\nP=? [ F side=1 ];\n",
};

const editors = Object.fromEntries(PARTS.map((part) => [part, new Editor(at(part), part === "model" ? "Model" : "Properties", `Write here, such as:\n\n${BEGINNINGS[part]}`, {
  changed: () => changed(part),
  save: saveAll,
  check: () => (part === "model" ? checkAll() : checkHere()),
  format: () => format(part),
  hover: async (place) => (await ask("hover", { ...texts(), part, at: place }).catch(() => ({}))).text,
  completions: async (place) => (await ask("completions", { ...texts(), part, at: place }).catch(() => ({ items: [] }))).items,
})]));

const draftKey = (part) => `draft ${part} ${known.folder}/${files[part].name}`;
const isChanged = (part) => editors[part].text !== files[part].saved;
const isDirty = (part) => isChanged(part) || (files[part].name !== "" && !files[part].version); // or deleted

function marks() {
  for (const part of PARTS) {
    const dirty = isDirty(part);
    at(`${part}-tab`).textContent = `${dirty ? "● " : ""}${files[part].name || part}`;
    at(`${part}-tab`).title = dirty ? "not saved" : "";
  }
  at("save").disabled = !PARTS.some(isDirty);
  const { name } = files[shownPart()];
  for (const id of ["rename", "delete"]) at(id).disabled = !name;
  at("rename").title = name ? `Give ${name} another name` : "It has no file yet";
  at("delete").title = name ? `Delete ${name}` : "It has no file yet";
  at("save-as").title = `Save the ${shownPart()} under another name`;
  at("format").title = `Indent the ${shownPart()} (Shift+Alt+F)`;
}

const shownPart = () => PARTS.find((part) => !at(part).hidden);

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
    if (part === "model") { // what is known is about another one
      constants = ofModel = [];
      at("facts").replaceChildren();
      warn([]);
    }
    const kept = JSON.parse(localStorage.getItem(draftKey(part)) ?? "null"), draft = kept?.text === text ? null : kept;
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

async function format(part) {
  const { text } = editors[part], found = await ask("formatted", { text }).catch((error) => fail(error, "formatting"));
  if (found && text === editors[part].text) editors[part].format(found.text);
}

const ENDING = { model: ".prism", properties: ".props" };

/** A name that is asked for, with an ending of its kind; "" if none is given. */
function nameFor(part, question) {
  const before = files[part].name, ending = /\.\w+$/.exec(before)?.[0] ?? ENDING[part];
  const given = prompt(question, before || `model${ending}`)?.trim() ?? "";
  const name = !given || given.includes(".") ? given : given + ending, endings = known.endings[part];
  if (name && name !== before && !(/^\w/.test(name) && endings.some((e) => name.toLowerCase().endsWith(e))))
    throw new Error(`'${name}' is no name of ${part === "model" ? "a model" : "properties"}: it ends with one of ${endings.join(" ")}`);
  return name;
}

let filing = 0, filed = 0; // what is being done with files, and what was begun

/** Do something with the file of a text. The names that are shown are those afterwards. */
async function withFile(part, what, does) {
  let isNewer = false;
  trouble();
  filing++, filed++;
  try {
    await does(part);
    known = await ask("project");
  } catch (error) {
    fail(error, `${what} the ${part}`);
    isNewer = error.newer;
  }
  filing--;
  if (isNewer) await outside();
  PARTS.forEach(choose);
  marks();
  address();
}

async function saveAll() {
  for (const part of PARTS.filter(isDirty)) {
    const { name, version } = files[part];
    await withFile(part, "saving", name ? () => write(part, name, version) : saveAs);
  }
}

async function write(part, name, version) {
  const file = files[part], { text } = editors[part], found = await ask("write", { name, text, version });
  log(`saved ${name}`);
  became(part, file, { name, version: found.version, saved: text });
}

/** A text has another file now, unless it was another text meanwhile. */
function became(part, before, file) {
  if (files[part] !== before) return;
  localStorage.removeItem(draftKey(part));
  files[part] = file;
  noConflict(part);
  changed(part);
  address();
}

async function saveAs(part) {
  const name = nameFor(part, `A name for the ${part}:`);
  if (!name) return;
  const own = name === files[part].name, { version } = own ? files[part] : await ask("read", { name });
  if (own || !version || confirm(`${name} exists. Replace it?`)) await write(part, name, version);
}

async function rename(part) {
  const file = files[part], { name } = file, fresh = nameFor(part, `A new name for ${name}:`);
  if (!fresh || fresh === name) return;
  await ask("rename", { name, new: fresh });
  log(`renamed ${name} to ${fresh}`);
  became(part, file, { ...file, name: fresh });
}

async function remove(part) {
  const file = files[part], { name, version } = file;
  if (!confirm(`Delete ${name}?${isChanged(part) ? " Its changes that are not saved go with it." : ""}`)) return;
  await ask("delete", { name, version });
  log(`deleted ${name}`);
  if (files[part] !== file) return;
  localStorage.removeItem(draftKey(part));
  await open(part, "");
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
  if (filing) return;
  const open = PARTS.filter((part) => files[part].name), before = filed;
  const found = await ask("versions", { names: open.map((part) => files[part].name) });
  if (filed !== before) return; // these are not the changes of others
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
    if (!version) { // deleted: the text stays
      file.version = "";
      noConflict(part);
      changed(part);
      trouble(file.name, "it was deleted on disk; its text is still here, and Save writes it again");
      continue;
    }
    const { text } = await ask("read", { name: file.name });
    if (files[part] !== file || file.version === version) continue; // opened or settled meanwhile
    const same = text === editors[part].text;
    if (!file.version) trouble(); // it is there again
    if (!same && isChanged(part)) conflict(part, text, version);
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

let timer = null, analysed = 0, exploring = null, listOf = null, isFaulty = false;

function later() {
  if (troubleOf && troubleOf !== JSON.stringify(job())) trouble();
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
  isFaulty = !found.list && !!now.properties.trim(); // the list is that of an earlier text then
  if (found.list) list = found.list;
  listOf = JSON.stringify(now);
  timed = found.timed ?? timed;
  const isEmpty = !now.model.trim();
  constants = found.constants ?? (isEmpty ? [] : constants); // the fields stay while a text is faulty
  ofModel = found.of_model ?? (isEmpty ? [] : ofModel);
  showConstants();
  showList();
  const errors = faults.filter((f) => f.severity === "error").length;
  tell(faults.length ? `${faults[0].part}: ${faults[0].message}` : isEmpty ? "There is no model yet: write one, or choose a file above." : "", errors > 0);
  if (!seenFaults.some((f) => f.severity === "error") && !isEmpty && ofModel.every((name) => values[name])) timer = setTimeout(explore, 500);
}

/** Faults that only the states show. */
async function explore() {
  exploring = new AbortController();
  try {
    const { states, faults, about } = await run("explore", { do: "explore", ...job() }, { signal: exploring.signal });
    if (faults.length) editors.model.show([...seenFaults, ...faults]);
    if (!at("state").classList.contains("bad")) tell([`${states.toLocaleString("en")} reachable states`, about].filter(Boolean).join("; "));
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
      make("input", { name: c.name, size: 9, value: store[c.name] ?? "", placeholder: box === "ranges" && c.type === "double" ? "0.1:0.1:1" : hint, autocomplete: "off", input: (e) => {
        store[c.name] = e.target.value.trim();
        sessionStorage.setItem(box, JSON.stringify(store));
        if (box === "constants") later();
      }, keydown: (e) => e.key === "Enter" && box === "constants" && checkAll() }))));
  }
}

// ------------------------------------------------------------------------------------------ jobs

const job = () => ({ ...texts(), constants: { ...values }, options: { ...options } });

const lanes = {}; // a worker does one job at a time: the jobs that wait, and the one that runs

/** Whether each of these constants has a value; if not, its field gets the focus. Ranges are values
 * where there are fields for them. */
function complete(needed, box = "constants") {
  const open = needed.find((name) => !values[name] && !(box === "ranges" && ranges[name]));
  if (!open) return true;
  trouble("constants", `${open} has no value: write one into its field`, JSON.stringify(job()));
  if (box === "constants") showTool("check");
  at(box).querySelector(`[name="${open}"]`)?.focus();
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
  const asked = todo.asked(), of = JSON.stringify(job());
  let found;
  try {
    found = await run(lane.worker, asked, { told, signal: lane.running.signal });
  } catch (error) {
    const isListed = ["check", "estimate"].includes(asked.do) && of === JSON.stringify(job()); // beside its property
    fail(error, what, isListed, of);
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
const CANCELLED = "cancelled";
const HOW = ["check", "estimate"];
const keyOf = (p, how = "check") => `${how} ${p.name}:${p.text}`;

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
  const seenBy = (p) => HOW.map((how) => results.get(keyOf(p, how))).filter(Boolean);
  const seen = list.map((p) => seenBy(p).map(({ of, errorOf, ...one }) => ({ ...one, isOld: of !== now, isPast: errorOf !== now })));
  forget();
  at("no-properties").hidden = list.length > 0;
  at("list").classList.toggle("old", isFaulty);
  show(at("list"), [list, seen, isFaulty], () => list.map((p, number) => listed(p, number, seen[number])));
  experiment.enable();
  simulation.enable();
}

/** The item of a property: its text, and its results if it was checked or estimated. */
function listed(p, number, answers) {
  const name = nameOf(p);
  const item = make("li", {}, button(p.name ? `"${p.name}": ${p.text}` : p.text, () => { showText("properties"); editors.properties.go(p.at); }, { class: "link mono", title: "Go to the text" }), make("br"));
  if (p.fault) { // it does not follow the grammar
    item.append(make("pre", { class: "of bad" }, p.fault));
    return item;
  }
  item.append(
    button("Check", () => check(number), { "aria-label": `Check ${name}`, title: "Check it (Ctrl+Enter at its text)", disabled: isFaulty }),
    button("Estimate", () => check(number, "estimate"), { "aria-label": `Estimate ${name}`, title: "Estimate it from random paths", disabled: isFaulty }));
  for (const answer of answers) item.append(answered(p, number, answer));
  return item;
}

/** What one way of answering a property has found, and what went wrong the last time. */
function answered(p, number, { result, error, isOld, isPast }) {
  const item = make("div", { class: isOld ? "old result" : "result" });
  if (result) {
    const mark = result.holds === null ? "" : result.holds ? "✓ " : "✗ ";
    item.append(make("span", { class: `value ${result.holds === null ? "" : result.holds ? "good" : "bad"}` }, mark + result.value),
      make("span", { class: "of" }, [isOld ? "before the last changes" : "", result.sampled ? `sampled: ${result.accuracy}` : result.accuracy, result.sampled ? "" : result.bounds, result.about, `${result.seconds.toFixed(3)} s`].filter(Boolean).join("; ")),
      " ", result.explains ? button("Why?", () => explain("explain", number), { title: "Counterexample or witness" }) : "",
      p.chooses && !result.sampled ? button("Strategy", () => explain("strategy", number)) : "",
      result.lines.length ? make("pre", {}, result.lines.join("\n")) : "");
  }
  if (error === CANCELLED) item.append(" ", make("span", { class: "of" }, error));
  else if (error && !isPast) item.append(" ", make("pre", { class: "of bad" }, error));
  return item;
}

/** The list, which is that of the text after a moment. */
async function currentList() {
  const isOld = () => listOf !== JSON.stringify(texts());
  if (isOld()) clearTimeout(timer); // a second analysis would take the answer of this one for an old one
  for (let tries = 0; isOld() && tries < 9; tries++) await analyse();
  if (isOld()) return []; // the server has ended, and that is told
  if (isFaulty) {
    trouble("check", at("state").title, JSON.stringify(job()));
    return [];
  }
  if (!list.length) trouble("check", "there is no property yet: write one", JSON.stringify(job()));
  return list;
}

/** The tab of checks, also where it is below the texts. */
function showCheck() {
  showTool("check");
  at("check").scrollIntoView({ block: "nearest" });
}

async function checkAll(how) {
  showCheck();
  (await currentList()).forEach((p, number) => p.fault || check(number, how));
}

/** Check the property at the cursor: the last one that begins before it, or in its line. */
async function checkHere() {
  showCheck();
  const now = await currentList(), { at, from, to } = editors.properties.cursor;
  const number = Math.max(now.findLastIndex((p) => p.at <= at), now.findIndex((p) => from <= p.at && p.at <= to), 0);
  if (now[number]?.fault) trouble("check", now[number].fault, JSON.stringify(job()));
  else if (now.length) check(number);
}

const sampling = () => Object.fromEntries([...at("sampling").querySelectorAll("input, select")].map((field) => [field.name, field.value.trim()]).filter(([, text]) => text));

/** how: "check", or "estimate" from random paths. */
async function check(number, how = "check") {
  const property = list[number];
  let of = "";
  const asked = () => {
    of = JSON.stringify(job());
    return { do: how, ...job(), property: property.text, sampling: sampling() };
  };
  const found = await queue("check", asked, nameOf(property), property.constants);
  if (found.incomplete) return;
  const { error } = found, key = keyOf(property, how);
  results.set(key, error ? { ...results.get(key), error: error.name === "AbortError" ? CANCELLED : error.message, errorOf: of } : { result: found, of });
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
let forgetDistribution = () => {};

/** Facts of another text or of other values are no longer those of the model. */
function forget() {
  forgetDistribution();
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
  const property = list[number];
  let given = null;
  const asked = () => {
    const { result, of } = results.get(keyOf(property)) ?? {}; // the same digits as beside the button
    const value = result && of === JSON.stringify(job()) ? `${result.value} (${result.accuracy})` : "";
    return given = { do: what, ...job(), property: property.text, value, room: room(400) };
  };
  const found = await queue("check", asked, `${what === "explain" ? "explaining" : "strategy of"} ${nameOf(property)}`, property.constants);
  if (found.error) return;
  log(found.text);
  draw(found, what === "strategy" ? given : null);
}

// ----------------------------------------------------------------------------------------- graph

let strategyOf = null; // the job of the strategy that is shown: its files are of the same texts

function draw({ text, page }, strategy = null) {
  strategyOf = strategy;
  at("strategy-files").hidden = !strategy;
  at("graph-text").textContent = text ?? "";
  at("graph-text").hidden = !text;
  showTool("graph");
  const frame = at("drawn").cloneNode(); // a new one: Chromium leaves one blank that was out of sight
  frame.hidden = !page;
  if (page) frame.src = page;
  at("drawn").replaceWith(frame);
}

async function drawModel() {
  const found = await queue("draw", () => ({ do: "page", ...job(), states: Math.max(1, whole(at("draw-states").value)), room: room(240) }), "drawing");
  if (!found.error) draw(found);
}

/** The pixels that the tab leaves for a picture below what is `above` high, in it and in the page. */
function room(above) {
  const { clientWidth, clientHeight } = at("tools");
  return [clientWidth - 50, Math.max(270, Math.min(clientHeight, innerHeight) - above)];
}

async function drawNear(around) {
  const found = await queue("draw", () => ({ do: "graph", ...job(), around, room: room(240) }), "drawing");
  if (!found.error) draw(found);
}

// ----------------------------------------------------------------------------------------- start

async function exported(kind) {
  const found = await queue("draw", () => ({ do: "export", ...job(), kind }), `export of .${kind}`);
  if (!found.error) saveFiles(found.files, `.${kind}`);
}

async function strategyFiles(kind) {
  const asked = { ...strategyOf, do: "strategy files", kind };
  const found = await enqueue("check", () => asked, `export of the strategy (${kind})`);
  if (!found.error) saveFiles(found.files, kind);
}

/** Save files of the model, under its name. */
function saveFiles(texts, kind) {
  const base = files.model.name.replace(/\.\w+$/, "") || "model";
  for (const [name, text] of Object.entries(texts)) save(name.replace(/^model/, base), text);
  log(`exported ${Object.keys(texts).length} file(s) of kind ${kind}`);
}

function exportResults() {
  const seen = list.flatMap((p) => HOW.map((how) => [p, results.get(keyOf(p, how))?.result])).filter(([, r]) => r);
  save("results.csv", csv([["property", "value", "accuracy", "bounds", "seconds"], ...seen.map(([p, r]) => [nameOf(p), r.value, r.accuracy, r.bounds, r.seconds])]), "text/csv");
}

// What the tabs with a script of their own take from here.
const bench = {
  values, ranges, job, stateOf, complete, queue, enqueue, log, trouble, show, drawNear,
  get list() { return list; }, get constants() { return constants; }, get timed() { return timed; },
};
const experiment = experiments(bench), simulation = simulator(bench);
forgetDistribution = distributions(bench);
const showText = tabs(at("text-tabs"), marks);
const showTool = tabs(at("tool-tabs"), (id) => id === "experiment" && experiment.draw());

at("properties-file").addEventListener("change", (e) => open("properties", e.target.value));
at("model-file").addEventListener("change", (e) => openModel(e.target.value));
const clicks = {
  save: saveAll, "save-as": () => withFile(shownPart(), "saving", saveAs), rename: () => withFile(shownPart(), "renaming", rename),
  delete: () => withFile(shownPart(), "deleting", remove), format: () => format(shownPart()),
  build, "check-all": () => checkAll(), "estimate-all": () => checkAll("estimate"),
  draw: drawModel, "draw-near": () => drawNear(at("around").value),
  "export-results": exportResults, "log-clear": () => at("log-lines").replaceChildren(),
};
for (const [id, does] of Object.entries(clicks)) at(id).addEventListener("click", does);
for (const one of at("strategy-files").querySelectorAll("button")) one.addEventListener("click", () => strategyFiles(one.dataset.kind));
at("around").addEventListener("keydown", (e) => e.key === "Enter" && drawNear(at("around").value));
addEventListener("keydown", (e) => {
  if (e.key !== "s" || !(e.ctrlKey || e.metaKey) || e.defaultPrevented) return;
  e.preventDefault();
  saveAll();
});
addEventListener("keydown", (e) => {
  if (e.key !== "F5" || e.ctrlKey || e.shiftKey || e.altKey || e.metaKey) return; // Ctrl+F5 reloads the page
  e.preventDefault();
  if (!e.repeat) checkAll();
});
addEventListener("keydown", (e) => e.key === "Escape" && !e.defaultPrevented && Object.values(lanes).forEach(cancel));
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => (experiment.draw(), simulation.draw()));
setInterval(() => document.hidden || outside().catch((error) => tell(error.message, true)), 2000);

project.then(async (found) => {
  known = found;
  at("folder").textContent = found.folder;
  at("folder").title = `symcheck ${found.version}`;
  Object.assign(values, JSON.parse(sessionStorage.getItem("constants") ?? "{}"));
  Object.assign(ranges, JSON.parse(sessionStorage.getItem("ranges") ?? "{}"));
  at("exports").replaceChildren(...found.exports.map((kind) => button(`.${kind}`, () => exported(kind))));
  optionFields(found.options, options, later);
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
