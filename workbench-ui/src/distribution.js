// The distributions over the states, in the tab of checks.
import { at, make, save } from "./dom.js";

/** bench: what the page has: texts, jobs and log. Gives a function that forgets what is shown. */
export function distributions(bench) {
  let of = "", shown = null; // the model, and what was asked

  async function compute(time) {
    let asked;
    const found = await bench.queue("check", () => {
      of = bench.stateOf();
      return (asked = { do: "distribution", ...bench.job(), time });
    }, time ? `the distribution at time ${time}` : "the steady state");
    if (found.error || of !== bench.stateOf()) return;
    shown = asked;
    const { variables, rows, positive, within, states, about, seconds } = found;
    const count = (n) => n.toLocaleString("en");
    at("distribution-about").textContent = `${time ? `At time ${time}` : "In the long run"}, ${count(positive)} of ${count(states)} states have ${within ? "more than the error" : "positive probability"}; ${about}`
      + (rows.length < positive ? `. These are the ${rows.length} likeliest:` : "");
    at("distribution-table").replaceChildren(make("tr", {}, ...[...variables, "probability"].map((h) => make("th", {}, h))),
      ...rows.map((row) => make("tr", {}, ...row.map((x) => make("td", {}, x)))));
    at("distribution-csv").disabled = false;
    bench.log(`${at("distribution-about").textContent}, ${seconds.toFixed(3)} s`);
  }

  async function saved() {
    const found = await bench.enqueue("check", () => ({ ...shown, all: true }), "the probabilities of all states");
    if (!found.error) save("distribution.csv", found.csv, "text/csv");
  }

  at("steady-state").addEventListener("click", () => compute(""));
  at("transient").addEventListener("click", () => compute(at("time").value.trim() || "0"));
  at("time").addEventListener("keydown", (e) => e.key === "Enter" && at("transient").click());
  at("distribution-csv").addEventListener("click", saved);

  return () => {
    if (!shown || of === bench.stateOf()) return;
    shown = null;
    at("distribution-about").textContent = "";
    at("distribution-table").replaceChildren();
    at("distribution-csv").disabled = true;
  };
}
