// Indentation while typing: blocks of the model are indented, and their ends are not.
import { indentOnInput, indentService } from "@codemirror/language";
import { countColumn, EditorState } from "@codemirror/state";

const WORDS = "module|rewards|init|system|player|observables|invariant";
const BEGINS = new RegExp(`^\\s*(${WORDS})\\b`), ENDS = new RegExp(`^\\s*end(${WORDS})\\b`);
const opens = (text) => BEGINS.test(text) && !text.includes(`end${BEGINS.exec(text)[1]}`);

/** The lines before a place, the nearest first; a break that is only being made ends one of them. */
function* before(context, place) {
  const { doc } = context.state, own = context.lineAt(place);
  const line = doc.lineAt(place);
  if (own.from > line.from) yield context.lineAt(place, -1).text;
  for (let number = line.number - 1; number > 0; number--) yield doc.line(number).text;
}

/** The columns of a line: those of the line before, one step more in a block, and those of the
 * block for its end. */
function columns(context, place) {
  const { tabSize } = context.state;
  const of = (text) => countColumn(text, tabSize, text.search(/\S|$/));
  const isEnd = ENDS.test(context.lineAt(place).text);
  let depth = 1;
  for (const text of before(context, place)) {
    if (isEnd) {
      depth += ENDS.test(text) - opens(text);
      if (!depth) return of(text);
    } else if (text.trim()) return of(text) + (opens(text) ? context.unit : 0);
  }
  return null;
}

export const indentation = [
  indentService.of(columns), indentOnInput(),
  EditorState.languageData.of(() => [{ indentOnInput: new RegExp(`${ENDS.source}$`) }]),
];
