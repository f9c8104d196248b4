// A stand-in for the module `vscode`: what the extension and its client ask of it, and no editor.
const Module = require("node:module");
const path = require("node:path");
const { pathToFileURL, fileURLToPath } = require("node:url");

class Disposable { dispose() {} }
class EventEmitter {
  constructor() { this.heard = []; this.event = (f, self) => (this.heard.push(f.bind(self)), new Disposable()); }
  fire(value) { this.heard.forEach((f) => f(value)); }
  dispose() {}
}
class Position { constructor(line, character) { Object.assign(this, { line, character }); } }
class Range {
  constructor(...ends) {
    [this.start, this.end] = ends.length === 2 ? ends : [new Position(ends[0], ends[1]), new Position(ends[2], ends[3])];
  }
}
class CodeLens { constructor(range, command) { Object.assign(this, { range, command }); } }
class Diagnostic { constructor(range, message, severity) { Object.assign(this, { range, message, severity }); } }
class CancellationTokenSource {
  constructor() { this.token = { isCancellationRequested: false, onCancellationRequested: () => new Disposable() }; }
  cancel() {} dispose() {}
}
const uri = (text) => ({ toString: () => text, scheme: "file", get fsPath() { return fileURLToPath(text); }, with() { return this; } });

/** An object whose missing parts are classes without abilities: the client inherits from many. */
const open = (known) => new Proxy(known, {
  get: (all, name) => (name in all || typeof name === "symbol" ? all[name] : (all[name] = class { constructor() {} })),
});
const event = () => new Disposable();
const kind = (value) => ({ value, append: (part) => kind(value ? `${value}.${part}` : part) });

function editor(settings) {
  const seen = { settings, commands: {}, lenses: [], errors: [], faults: {}, status: [], updates: [] };
  const opened = new EventEmitter();
  const inside = (section) => Object.fromEntries(
    Object.entries(settings).filter(([name]) => name.startsWith(`${section}.`)).map(([name, value]) => [name.slice(section.length + 1), value]),
  );
  const configuration = (section) => ({
    get: (name, usual) => (section === undefined ? inside(name) : settings[`${section}.${name}`] ?? usual),
    inspect: (name) => ({ workspaceValue: settings[`${section}.${name}`] }),
    update: async (...words) => seen.updates.push([section, ...words]),
  });
  const register = async (name, f) => { seen.commands[name] = f; };
  const vscode = open({
    Disposable, EventEmitter, Position, Range, CodeLens, Diagnostic, CancellationTokenSource,
    version: "1.90.0",
    CodeActionKind: { Empty: kind(""), QuickFix: kind("quickfix") },
    Uri: { parse: uri, file: (name) => uri(pathToFileURL(name).href) },
    ConfigurationTarget: { Workspace: 2 },
    ProgressLocation: { Window: 10 },
    DiagnosticSeverity: { Error: 0, Warning: 1, Information: 2, Hint: 3 },
    env: { appName: "stub", language: "en" },
    window: open({
      tabGroups: { all: [], onDidChangeTabs: event },
      visibleTextEditors: [],
      createOutputChannel: () => open({ appendLine() {}, append() {}, show() {}, dispose() {} }),
      onDidChangeActiveTextEditor: event,
      showErrorMessage: async (text) => void seen.errors.push(text),
      showInformationMessage: async () => undefined,
      setStatusBarMessage: (text) => seen.status.push(text),
      withProgress: (_, work) => work(),
    }),
    workspace: new Proxy({
      textDocuments: [], notebookDocuments: [], workspaceFolders: undefined, isTrusted: true,
      getConfiguration: configuration,
      onDidOpenTextDocument: opened.event,
      getWorkspaceFolder: () => undefined,
      createFileSystemWatcher: () => open({ onDidCreate: event, onDidChange: event, onDidDelete: event, dispose() {} }),
    }, { get: (all, name) => (name in all ? all[name] : event) }),
    commands: {
      registerCommand: (name, f) => { register(name, f); return new Disposable(); },
      executeCommand: async (name, ...words) => seen.commands[name]?.(...words),
    },
    languages: new Proxy({
      match: (selector, document) => ([selector].flat().some((s) => s.language === document.languageId) ? 10 : 0),
      createDiagnosticCollection: () => ({ set: (at, faults) => { seen.faults[at.toString()] = faults; }, delete() {}, clear() {}, dispose() {} }),
      registerCodeLensProvider: (_, provider) => { seen.lenses.push(provider); return new Disposable(); },
    }, { get: (all, name) => (name in all ? all[name] : event) }),
  });
  seen.vscode = vscode;
  seen.open = (file, languageId, text) => {
    const document = { uri: uri(pathToFileURL(path.resolve(file)).href), languageId, version: 1, getText: () => text, isClosed: false };
    vscode.workspace.textDocuments.push(document);
    opened.fire(document);
    return document;
  };
  return seen;
}

/** Load the bundle with a stand-in. */
function load(settings = {}) {
  const seen = editor(settings);
  const usual = Module._load;
  Module._load = (name, ...words) => (name === "vscode" ? seen.vscode : usual(name, ...words));
  try {
    const bundle = require.resolve("../dist/extension.js");
    delete require.cache[bundle];
    seen.extension = require(bundle);
  } finally {
    Module._load = usual;
  }
  return seen;
}

module.exports = { load, CancellationTokenSource };
