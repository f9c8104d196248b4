// The tab of the simulator: a path that grows step by step.
import { at, button, csv, make, option, save } from "./dom.js";
import { Chart } from "./plot.js";

const SHOWN = 300; // rows of a path

/** bench: what the page has: texts, jobs and log. */
export function simulator(bench) {
  let path = [], sim = null, shownVariables = new Set();
  let of = "", timed = false; // the model of the path, and whether it has time
  const chart = new Chart(at("sim-chart"), "path", { steps: true });

  async function move(asked, what) {
    let now = "";
    const found = await bench.queue("simulate", () => {
      now = bench.stateOf();
      return { ...bench.job(), ...asked };
    }, what);
    if (found.error) return;
    path = path.slice(0, found.length - found.rows.length).concat(found.rows);
    if (asked.do === "start") [of, timed] = [now, bench.timed];
    if (asked.do === "start") at("sim-seed").placeholder = found.seed, bench.log(`new path, seed ${found.seed}`), (shownVariables = new Set(found.variables.slice(0, 3)));
    sim = found;
    showPath();
  }

  const start = () => move({ do: "start", seed: at("sim-seed").value, from: at("sim-from").value.trim() }, "new path");
  const step = (more) => move({ do: "move", ...more }, "simulator");
  const far = () => (at("sim-unit").value === "time" ? { time: at("sim-far").value } : { steps: at("sim-far").value.trim() });

  const isOld = () => sim !== null && of !== bench.stateOf();

  /** What can be done: it depends on the path, whether it is one of the text, the type of the
   * model, and the properties. */
  function enable() {
    const ends = !sim?.choices.length || isOld();
    const choosing = bench.list.flatMap((p, i) => (p.chooses ? [[i, p.name || p.text]] : []));
    const before = at("sim-property").value;
    bench.show(at("sim-property"), choosing, () => (choosing.length ? choosing : [["", "none"]]).map((one) => option(...one)));
    if (choosing.some(([i]) => String(i) === before)) at("sim-property").value = before;
    at("sim-property").disabled = !choosing.length;
    at("sim-property").title = choosing.length ? "" : "There is no property whose value a strategy attains";
    at("sim-unit").options[1].disabled = !bench.timed;
    if (!bench.timed) at("sim-unit").value = "steps";
    at("sim-step").disabled = at("sim-run").disabled = ends;
    at("sim-follow").disabled = ends || !choosing.length;
    at("sim-back").disabled = at("sim-reset").disabled = !(sim?.length > 1);
    at("sim-csv").disabled = !sim;
    at("sim-graph").disabled = !sim || isOld();
    if (sim) showState();
  }

  /** The last state of the path, and its choices. */
  function showState() {
    const { labels, totals, choices, length, note } = sim, old = isOld();
    const earned = Object.entries(totals).map(([n, x]) => `${n} so far ${Number(x.toPrecision(6))}`);
    const time = timed ? `time ${Number(path.at(-1)[1].toPrecision(6))}` : "";
    const past = old ? "of the text before the last changes: start a new path" : "";
    const words = [sim.state.replaceAll(" & ", ", "), time, labels.length ? `labels ${labels.join(", ")}` : "", ...earned, choices.length ? "" : "a deadlock", note ?? "", past].filter(Boolean).join("; ");
    bench.show(at("sim-state"), [length, words], () => [make("strong", {}, `Step ${length - 1}: `), words]);
    bench.show(at("sim-choices"), [choices, old], () => choices.map((c, i) => make("li", {}, make("code", {}, `${c.module ? `${c.module}: ` : ""}${c.text}`),
      ...c.branches.map(([weight, change], j) => button(`${weight}: ${change}`, () => step({ move: "step", choice: i, branch: j }), { disabled: old })))));
  }

  function showPath() {
    enable();
    const { variables, rewards } = sim;
    showRows();
    const numbers = (row, name) => [...row[2], ...row[3]][[...variables, ...rewards].indexOf(name)];
    at("sim-variables").replaceChildren(...[...variables, ...rewards].map((name) => make("label", {}, make("input", { type: "checkbox", checked: shownVariables.has(name), change: (e) => {
      e.target.checked ? shownVariables.add(name) : shownVariables.delete(name);
      showPath();
    } }), ` ${name}`)));
    chart.show([...shownVariables].flatMap((name) => path.map((row) => ({ x: row[1], y: Number(numbers(row, name)), series: name }))), "time", "value");
  }

  const head = () => ["step", "transition", "time", ...sim.variables, ...sim.rewards.map((r) => `${r} (state)`), ...sim.rewards.map((r) => `${r} (transition)`)];
  const cells = ([transition, time, state, reward, earned], i) => [i, transition, Number(time.toPrecision(6)), ...state.map(String), ...reward, ...(earned.length ? earned : reward.map(() => ""))];

  /** The last rows of the path. A click on one goes back to its step. */
  function showRows() {
    const titles = head(), last = path.length - 1, from = Math.max(0, path.length - SHOWN);
    const row = (i) => {
      const [number, ...others] = cells(path[i], i);
      const to = i === last ? number : button(number, () => {}, { class: "link", "aria-label": `Back to step ${i}` });
      const back = i < last && (() => String(getSelection()) || step({ move: "back", to: i }));
      return make("tr", { class: i === last ? "now" : "", title: i === last ? "" : `Back to step ${i}`, click: back }, make("td", {}, to), ...others.map((x) => make("td", {}, String(x))));
    };
    at("sim-path").replaceChildren(make("tr", {}, ...titles.map((h) => make("th", {}, h))), ...(from ? [make("tr", {}, make("td", { class: "left", colspan: titles.length }, `${from} earlier steps are in the CSV file and in the plot`))] : []),
      ...path.slice(from).map((_, i) => row(from + i)));
    at("sim-path").parentElement.scrollTop = 1e9;
  }

  const clicks = {
    start, step: () => step({ move: "step" }), run: () => step({ move: "run", ...far() }), back: () => step({ move: "back" }), reset: () => step({ move: "restart" }),
    follow: () => step({ move: "run", ...far(), property: bench.list[at("sim-property").value]?.text }),
    graph: () => bench.drawNear(sim.state), csv: () => save("path.csv", csv([head(), ...path.map(cells)]), "text/csv"),
  };
  for (const [name, does] of Object.entries(clicks)) at(`sim-${name}`).addEventListener("click", does);
  for (const [name, does] of [["from", start], ["seed", start], ["far", () => at("sim-run").click()]]) at(`sim-${name}`).addEventListener("keydown", (e) => e.key === "Enter" && does());
  at("sim-plot").addEventListener("toggle", () => chart.draw());
  return { enable, draw: () => chart.draw() };
}
