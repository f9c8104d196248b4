// The editor of one text. Faults, colours, help and completions come from the server.
import { autocompletion, closeBrackets, closeBracketsKeymap, completionKeymap } from "@codemirror/autocomplete";
import { defaultKeymap, history, historyKeymap, isolateHistory } from "@codemirror/commands";
import { bracketMatching, indentUnit } from "@codemirror/language";
import { lintGutter, lintKeymap, setDiagnostics } from "@codemirror/lint";
import { highlightSelectionMatches, searchKeymap } from "@codemirror/search";
import { EditorState, StateEffect, StateField } from "@codemirror/state";
import {
  Decoration, EditorView, drawSelection, highlightActiveLine, highlightSpecialChars, hoverTooltip, keymap, lineNumbers, placeholder,
} from "@codemirror/view";
import { make } from "./dom.js";
import { indentation } from "./indent.js";

const setColours = StateEffect.define();
const colours = StateField.define({
  create: () => Decoration.none,
  update(marks, change) {
    marks = marks.map(change.changes);
    for (const effect of change.effects) if (effect.is(setColours)) marks = effect.value;
    return marks;
  },
  provide: (field) => EditorView.decorations.from(field),
});

/** The little Markdown that the help is written in. */
function markdown(text) {
  const box = make("div", { class: "help" });
  text.split("```").forEach((part, i) => {
    if (i % 2) box.append(make("pre", {}, part.replace(/^\w*\n/, "").trimEnd()));
    else if (part.trim()) box.append(make("p", {}, ...part.trim().split("`").map((t, j) => (j % 2 ? make("code", {}, t) : t))));
  });
  return box;
}

export class Editor {
  /** beginning: what an empty text may become; hooks: changed(), save(), check(), format(), hover(at), completions(at) */
  constructor(parent, label, beginning, hooks) {
    this.hooks = hooks;
    this.extensions = [
      lineNumbers(), highlightSpecialChars(), history(), drawSelection(), bracketMatching(), closeBrackets(),
      highlightActiveLine(), highlightSelectionMatches(), lintGutter(), colours, indentUnit.of("  "), indentation, placeholder(() => make("pre", {}, beginning)),
      EditorView.contentAttributes.of({ "aria-label": label, spellcheck: "false" }),
      autocompletion({ icons: false, override: [(context) => this.complete(context)] }),
      hoverTooltip((view, at) => this.help(at)),
      keymap.of([
        { key: "Mod-s", run: () => (hooks.save(), true), preventDefault: true },
        { key: "Mod-Enter", run: () => (hooks.check(), true) },
        { key: "Shift-Alt-f", run: () => (hooks.format(), true) },
        ...closeBracketsKeymap, ...completionKeymap, ...lintKeymap, ...searchKeymap, ...historyKeymap, ...defaultKeymap,
      ]),
      EditorView.updateListener.of((update) => update.docChanged && hooks.changed()),
    ];
    this.view = new EditorView({ parent, state: this.state("") });
  }

  state(doc) {
    return EditorState.create({ doc, extensions: this.extensions });
  }

  get text() {
    return this.view.state.doc.toString();
  }

  /** Another file: no step of the history leads back to the last one. */
  open(text) {
    this.view.setState(this.state(text));
  }

  /** The same file, changed outside. */
  replace(text) {
    const at = Math.min(this.view.state.selection.main.head, text.length);
    this.view.dispatch({ changes: { from: 0, to: this.view.state.doc.length, insert: text }, selection: { anchor: at } });
  }

  /** The same text with other indentation: the cursor stays at its word. One step of the history. */
  format(text) {
    const { doc, selection } = this.view.state;
    if (text === doc.toString()) return;
    const line = doc.lineAt(selection.main.head), word = (s) => s.search(/\S|$/);
    const lines = text.split("\n"), number = Math.min(line.number, lines.length) - 1;
    const column = Math.max(0, word(lines[number]) + selection.main.head - line.from - word(line.text));
    const anchor = lines.slice(0, number).reduce((sum, l) => sum + l.length + 1, 0) + Math.min(column, lines[number].length);
    this.view.dispatch({ changes: { from: 0, to: doc.length, insert: text }, selection: { anchor }, scrollIntoView: true, annotations: isolateHistory.of("full") });
  }

  /** The place of the cursor, and where its line begins and ends. */
  get cursor() {
    const { doc, selection } = this.view.state, line = doc.lineAt(selection.main.head);
    return { at: selection.main.head, from: line.from, to: line.to };
  }

  show(faults, marks) {
    const most = this.view.state.doc.length;
    const action = (fault) => ({ title, from, to, text }) => ({ name: title, apply: (view, at) => // the text before may have changed
      view.dispatch({ changes: { from: at + from - fault.from, to: at + to - fault.from, insert: text }, userEvent: "input" }) });
    const inside = faults.filter((f) => f.from <= most).map((f) => ({ ...f, to: Math.min(f.to, most), actions: f.fixes.map(action(f)) }));
    this.view.dispatch(setDiagnostics(this.view.state, inside));
    if (!marks) return;
    const ranges = marks.filter(([from, to]) => from < to && to <= most).map(([from, to, kind]) => Decoration.mark({ class: `k-${kind}` }).range(from, to));
    this.view.dispatch({ effects: setColours.of(Decoration.set(ranges, true)) });
  }

  go(at) {
    this.view.dispatch({ selection: { anchor: Math.min(at, this.view.state.doc.length) }, scrollIntoView: true });
    this.view.focus();
  }

  async help(at) {
    const text = await this.hooks.hover(at);
    return text ? { pos: at, create: () => ({ dom: markdown(text) }) } : null;
  }

  async complete(context) {
    const word = context.matchBefore(/\w*/);
    const before = context.state.sliceDoc(Math.max(0, word.from - 1), word.from);
    if (!context.explicit && word.from === word.to && !'["{'.includes(before || " ")) return null;
    const items = await this.hooks.completions(context.pos);
    // the likeliest come first
    return { from: word.from, options: items.map((item, i) => ({ ...item, boost: Math.max(-99, 99 - i) })), validFor: /^\w*$/ };
  }
}
