// The tab of options.
import { at, make, option } from "./dom.js";

/** Fields for groups of options. Values other than the default are kept in `options`, as texts, and
 * are there again after a reload. */
export function optionFields(groups, options, changed) {
  const about = at("option-about"), kept = JSON.parse(sessionStorage.getItem("options") ?? "{}");

  /** Tell which options differ from their default. */
  function mark() {
    const differ = groups.flatMap(({ fields }) => fields.filter((o) => o.name in options));
    at("options-tab").textContent = differ.length ? "Options ●" : "Options";
    at("options-tab").title = differ.length ? `Not the default: ${differ.map((o) => o.words).join("; ")}` : "";
  }

  function field(o) {
    const set = (value) => {
      value === o.default || value === "" ? delete options[o.name] : (options[o.name] = value);
      row.classList.toggle("set", o.name in options);
      sessionStorage.setItem("options", JSON.stringify(options));
      mark();
      changed();
    };
    const described = { id: `option-${o.name}`, "aria-describedby": "option-about" };
    const [[other] = []] = o.values;
    let input;
    if (o.values.length === 1) input = make("input", { ...described, type: "checkbox", change: (e) => set(e.target.checked ? other : "") });
    else if (o.values.length) input = make("select", { ...described, change: (e) => set(e.target.value) }, option(o.default, o.default ? `${o.default} (default)` : "default"), ...o.values.map((one) => option(...one)));
    else input = make("input", { ...described, size: 9, placeholder: o.default || "default", autocomplete: "off", change: (e) => set(e.target.value.trim()) });
    const words = [make("span", {}, o.words), o.switch && make("code", {}, o.switch)].filter(Boolean);
    const tell = () => about.replaceChildren(...o.about.split("`").map((part, i) => (i % 2 ? make("code", {}, part) : part)));
    const row = make("label", { class: o.values.length === 1 ? "ticked" : "", mouseenter: tell, focusin: tell }, ...(o.values.length === 1 ? [input, ...words] : [...words, input]));
    if (o.name in kept) {
      options[o.name] = kept[o.name];
      o.values.length === 1 ? (input.checked = true) : (input.value = kept[o.name]);
      row.classList.add("set");
    }
    return row;
  }

  at("option-fields").replaceChildren(...groups.map(({ title, fields }) => make("fieldset", {}, make("legend", {}, title), ...fields.map(field))));
  mark();
}
