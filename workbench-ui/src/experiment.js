// The tab of experiments: ranges of constants, a plot and a table.
import { at, csv, make, option } from "./dom.js";
import { Chart } from "./plot.js";

const LISTED = 500; // rows of the table

/** bench: what the page has: texts, jobs and log. Gives the plot. */
export function experiments(bench) {
  let series = [], axis = ""; // the constant that was chosen for it
  const chart = new Chart(at("experiment-chart"), "experiment");

  async function experiment() {
    const asked = bench.list[at("experiment-property").value], keep = at("keep").checked;
    if (!bench.complete((asked ? [asked] : bench.list).flatMap((p) => p.constants), "ranges")) return;
    const given = Object.fromEntries(bench.constants.map((c) => [c.name, bench.ranges[c.name] || bench.values[c.name] || ""]));
    const mine = { rows: [], given };
    const add = (rows) => {
      if (!series.includes(mine)) { // a run that is refused changes nothing
        series = keep ? series : [];
        mine.run = series.push(mine);
      }
      mine.rows.push(...rows);
      plot();
    };
    const found = await bench.enqueue("check", () => ({ do: "experiment", ...bench.job(), constants: given, property: asked?.text ?? null }), "experiment", ({ rows }) => rows?.length && add(rows));
    if (found.error) return;
    mine.csv = found.csv;
    add([]);
    const errors = mine.rows.filter((r) => r.error).length;
    bench.log(`experiment: ${mine.rows.length} results${errors ? `, ${errors} of them errors` : ""}`, errors ? "bad" : "");
  }

  /** The plot, what it does not show, and the table. */
  function plot() {
    const rows = series.flatMap((s) => s.rows.map((r) => ({ ...r, run: s.run })));
    const names = [...new Set(rows.flatMap((r) => Object.keys(r.constants)))];
    const varying = names.filter((n) => new Set(rows.map((r) => r.constants[n])).size > 1);
    at("axis").replaceChildren(...(varying.length ? varying : names).map((n) => option(n)));
    if (varying.includes(axis)) at("axis").value = axis;
    const x = at("axis").value;
    const several = new Set(rows.map((r) => r.property)).size > 1;
    const others = varying.filter((n) => n !== x);
    const lineOf = (r) => [several || varying.length < 2 || series.length > 1 ? r.property : "", ...settings(r, others), series.length > 1 ? `run ${r.run}` : ""].filter(Boolean).join(", ");
    const place = (text) => (Number.isNaN(Number(text)) ? text : Number(text));
    const places = [...new Set(rows.filter((r) => x in r.constants).map((r) => place(r.constants[x])))];
    const point = (r, where) => ({ x: where, y: r.numbers[0], low: r.numbers[1], high: r.numbers[2], series: lineOf(r) });
    // What does not depend on the constant of the axis is a level line.
    const points = rows.filter((r) => r.numbers[0] !== null).flatMap((r) => (x in r.constants ? [point(r, place(r.constants[x]))] : places.map((where) => point(r, where))));
    points.sort((a, b) => a.x - b.x);
    const head = ["property", ...names, "value", "accuracy"];
    chart.show(points, x, several ? "value" : rows[0]?.property ?? "", series.length === 1 ? series[0].csv : csv([head, ...rows.map((r) => [r.property, ...names.map((n) => r.constants[n] ?? ""), r.text, r.accuracy])]));
    at("experiment-notes").replaceChildren(...notes(rows, x, names));
    at("experiment-table").replaceChildren(make("tr", {}, ...head.map((h) => make("th", { class: h === "property" || h === "accuracy" ? "left" : "" }, h))),
      ...rows.slice(-LISTED).map((r) => make("tr", {}, make("td", { class: "left" }, r.property), ...names.map((n) => make("td", {}, r.constants[n] ?? "")), make("td", {}, r.text), make("td", { class: "left" }, r.accuracy))));
  }

  const settings = (r, names) => names.filter((n) => n in r.constants).map((n) => `${n}=${r.constants[n]}`);

  /** Ranges of a run that have one value. */
  function single({ rows, given, csv }) {
    const valuesOf = (name) => [...new Set(rows.filter((r) => name in r.constants).map((r) => r.constants[name]))];
    const ranges = Object.entries(given).filter(([, text]) => csv !== undefined && text.includes(":"));
    return ranges.map(([name, text]) => [name, text, valuesOf(name)]).filter(([, , values]) => values.length === 1)
      .map(([name, text, [value]]) => `${name}=${value} is the only value of ${text}${text.split(":").length === 2 ? ", whose step is 1: write another step between its ends" : ""}`);
  }

  /** What the lines do not tell: single and level ones, results without a number, errors. */
  function notes(rows, x, names) {
    const level = [...new Set(rows.filter((r) => !(x in r.constants)).map((r) => r.property))];
    const found = [...new Set(series.flatMap(single))].map((text) => make("li", {}, text));
    if (x && level.length) found.push(make("li", {}, `${level.join(", ")} ${level.length > 1 ? "do" : "does"} not depend on ${x}: level lines`));
    const undrawn = new Map(); // by what they have in common
    for (const r of rows.filter((r) => r.numbers[0] === null)) {
      const key = JSON.stringify([r.property, r.error || r.text]);
      undrawn.set(key, [...(undrawn.get(key) ?? []), r]);
    }
    for (const [first, ...more] of undrawn.values()) {
      const where = settings(first, names).join(", ");
      const places = `${where && ` at ${where}`}${more.length ? ` and ${more.length} more` : ""}`;
      found.push(make("li", { class: first.error ? "bad" : "" }, `${first.property}${places}: ${first.error || `${first.text}, which is not drawn`}`));
    }
    if (rows.length > LISTED) found.push(make("li", {}, `the table has the last ${LISTED} of ${rows.length} results; CSV saves all`));
    return found;
  }

  /** What can be chosen: it depends on the properties. */
  function enable() {
    const all = [["", "all"], ...bench.list.flatMap((p, i) => (p.fault ? [] : [[i, p.name || p.text]]))];
    const before = at("experiment-property").value;
    bench.show(at("experiment-property"), all, () => all.map((one) => option(...one)));
    if (all.some(([i]) => String(i) === before)) at("experiment-property").value = before;
  }

  at("experiment-run").addEventListener("click", experiment);
  at("axis").addEventListener("change", () => {
    axis = at("axis").value;
    plot();
  });
  return { enable, draw: () => chart.draw() };
}
