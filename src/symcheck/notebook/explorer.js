// The widget of symcheck.notebook.Explorer: it shows what Python says, and tells it of buttons.

const element = (name, attributes = {}, ...inner) => {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key.startsWith("on")) made.addEventListener(key.slice(2), value);
    else if (typeof value === "boolean") made.toggleAttribute(key, value);
    else made.setAttribute(key, value);
  }
  made.append(...inner);
  return made;
};

const short = (number) => (Number.isInteger(number) ? String(number) : number.toPrecision(6));

function render({ model, el }) {
  const send = (message) => model.send(message);
  const left = element("div"), right = element("div");
  const root = element("div", { class: "symcheck", tabindex: "0" }, left, right);
  root.addEventListener("keydown", (event) => {
    if (event.target !== root) return;
    if (event.key === "ArrowRight") send({ do: "step" });
    else if (event.key === "ArrowLeft") send({ do: "back" });
    else return;
    event.preventDefault();
  });

  const button = (text, message, off = false, title = "") =>
    element("button", { onclick: () => send(message), disabled: off, title }, text);

  const choices = ({ choices }) => choices.map((choice, number) => element(
    "div", {},
    choice.action || choice.module,
    ...choice.branches.map(([probability, changes], branch) =>
      button(`${probability}: ${changes}`, { do: "step", choice: number, branch }, false,
        choice.text)),
  ));

  const table = ({ rows, variables, rewards }, first, continuous) => {
    const head = ["step", "transition", ...(continuous ? ["time"] : []), ...variables, ...rewards];
    const cells = ([transition, time, state, values], number) =>
      [first + number, transition, ...(continuous ? [short(time)] : []), ...state,
        ...values.map(short)];
    return element("table", {},
      element("tr", {}, ...head.map((text) => element("th", {}, text))),
      ...rows.map((row, number) => element("tr", {},
        ...cells(row, number).map((cell) => element("td", {}, String(cell ?? ""))))));
  };

  const draw = () => {
    const { path, first, continuous, pictures, picture, svg, note, error } = model.get("shown");
    const focused = root.contains(document.activeElement)
      ? document.activeElement.dataset?.key ?? "root" : null;
    const ended = path.choices.length === 0;
    const keyed = (made, key) => { made.dataset.key = key; return made; };
    const rows = element("div", { class: "path" }, table(path, first, continuous));
    left.replaceChildren(
      element("div", {},
        keyed(button("Step", { do: "step" }, ended, "a step at random (→)"), "step"),
        keyed(button("10 steps", { do: "run", steps: 10 }, ended), "run"),
        keyed(button("Back", { do: "back" }, path.length < 2, "(←)"), "back"),
        keyed(button("Restart", { do: "restart" }), "restart")),
      element("div", { class: "error", role: "alert" }, error),
      element("div", { class: "state" }, path.state,
        path.labels.length ? ` (${path.labels.map((label) => `"${label}"`).join(", ")})` : ""),
      element("div", { class: "choices" }, ...(ended ? ["deadlock"] : choices(path))),
      rows);
    rows.scrollTop = rows.scrollHeight;
    const select = keyed(element("select", {
      "aria-label": "picture",
      onchange: (event) => send({ do: "draw", picture: event.target.value }),
    }, ...pictures.map((name) => element("option", { selected: name === picture }, name))), "draw");
    const image = svg && element("img", {
      alt: picture, src: `data:image/svg+xml;charset=utf-8,${encodeURIComponent(svg)}`,
    });
    right.replaceChildren(select, element("div", { class: "drawing" }, image),
      element("div", {}, note));
    if (focused !== null)
      (root.querySelector(`[data-key="${focused}"]:not([disabled])`) ?? root).focus();
  };

  model.on("change:shown", draw);
  draw();
  el.append(root);
  return () => model.off("change:shown", draw);
}

export default { render };
