// Small helpers for the page.

export const at = (id) => document.getElementById(id);

/** An element with attributes (functions are listeners) and children. */
export function make(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === "function") element.addEventListener(name, value);
    else if (value !== undefined && value !== false) element.setAttribute(name, value === true ? "" : value);
  }
  element.append(...children.filter((child) => child !== ""));
  return element;
}

export const button = (text, click, attributes = {}) => make("button", { type: "button", click, ...attributes }, text);

export function option(value, text = value) {
  return make("option", { value }, text);
}

/** The whole number that a text is; otherwise 1. */
export const whole = (text) => (/^\d+$/.test(text) ? Number(text) : 1);

/** Save a text or a blob as a file of the browser. */
export function save(name, content, type = "text/plain") {
  const blob = content instanceof Blob ? content : new Blob([content], { type });
  const link = make("a", { href: URL.createObjectURL(blob), download: name });
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

export const csv = (rows) =>
  rows.map((row) => row.map((x) => (/[",\n]/.test(String(x)) ? `"${String(x).replaceAll('"', '""')}"` : x)).join(",") + "\n").join("");

/** Lists of tabs: arrows move, as in the ARIA pattern. */
export function tabs(list, shown = () => {}) {
  const all = [...list.querySelectorAll('[role="tab"]')];
  const show = (tab) => {
    for (const other of all) {
      const is = other === tab;
      other.setAttribute("aria-selected", is);
      other.tabIndex = is ? 0 : -1;
      at(other.getAttribute("aria-controls")).hidden = !is;
    }
    shown(tab.getAttribute("aria-controls"));
  };
  all.forEach((tab, i) => {
    tab.addEventListener("click", () => show(tab));
    tab.addEventListener("keydown", (event) => {
      const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      if (!step) return;
      const next = all[(i + step + all.length) % all.length];
      next.focus();
      show(next);
    });
  });
  show(all[0]);
  return (id) => show(all.find((tab) => tab.getAttribute("aria-controls") === id));
}
