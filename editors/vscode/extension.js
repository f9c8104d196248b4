// Starts symcheck-lsp and speaks with it; what an editor shows comes from there.
const fs = require("node:fs");
const os = require("node:os");
const path = require("node:path");
const vscode = require("vscode");
const { LanguageClient } = require("vscode-languageclient/node");

const LANGUAGES = ["prism", "prism-properties"];
const CLAIMED = { "*.pm": "prism", "*.props": "prism-properties" };

let client;

/** The file that a name or path stands for, or undefined. */
function executable(name) {
  const written = name.replace(/^~(?=[/\\])/, os.homedir());
  const folders = /[/\\]/.test(written) ? [""] : (process.env.PATH ?? "").split(path.delimiter);
  const endings = process.platform === "win32" ? [".exe", ".cmd", ""] : [""];
  return folders
    .flatMap((folder) => endings.map((ending) => path.join(folder, written + ending)))
    .find((file) => fs.existsSync(file) && fs.statSync(file).isFile());
}

/** Run a command of the server, and show what it answers. */
async function execute(command, words, next) {
  const options = { location: vscode.ProgressLocation.Window, title: "symcheck: checking" };
  const answer = await vscode.window.withProgress(options, () => next(command, words));
  if (typeof answer === "string") vscode.window.setStatusBarMessage(`symcheck: ${answer}`, 10000);
  return answer;
}

async function start() {
  const wanted = vscode.workspace.getConfiguration("symcheck").get("server.path", "symcheck-lsp");
  const command = executable(wanted);
  if (command === undefined) {
    const settings = "Open settings";
    const text =
      `symcheck: there is no language server '${wanted}'. ` +
      "pip install '.[lsp]' in a checkout of symcheck installs it; symcheck.server.path says where it is.";
    vscode.window.showErrorMessage(text, settings).then((choice) => {
      if (choice === settings)
        vscode.commands.executeCommand("workbench.action.openSettings", "symcheck.server.path");
    });
    return;
  }
  client = new LanguageClient(
    "symcheck",
    "symcheck",
    { command },
    {
      documentSelector: LANGUAGES.map((language) => ({ language })),
      middleware: { executeCommand: execute },
      synchronize: { configurationSection: "symcheck" },
    },
  );
  await client.start();
}

/** Check the property in which the cursor stands. */
async function checkHere() {
  const editor = vscode.window.activeTextEditor;
  if (editor === undefined || client === undefined) return undefined;
  const uri = editor.document.uri.toString();
  const lenses = await client.sendRequest("textDocument/codeLens", { textDocument: { uri } });
  const line = editor.selection.active.line;
  const lens = (lenses ?? []).find((l) => l.range.start.line <= line && line <= l.range.end.line);
  if (lens === undefined) {
    vscode.window.showInformationMessage("symcheck: the cursor is in no property of a model.");
    return undefined;
  }
  return vscode.commands.executeCommand(lens.command.command, ...lens.command.arguments);
}

/** Note in the settings of the workspace that .pm and .props are ours there. */
async function claim() {
  const files = vscode.workspace.getConfiguration("files");
  const known = files.inspect("associations")?.workspaceValue ?? {};
  await files.update("associations", { ...known, ...CLAIMED }, vscode.ConfigurationTarget.Workspace);
}

async function restart() {
  await deactivate();
  await start();
}

async function activate(context) {
  const { registerCommand } = vscode.commands;
  context.subscriptions.push(
    registerCommand("symcheck.checkHere", checkHere),
    registerCommand("symcheck.claim", claim),
    registerCommand("symcheck.restart", restart),
    vscode.workspace.onDidChangeConfiguration((event) => {
      if (event.affectsConfiguration("symcheck.server")) restart();
    }),
  );
  await start();
}

async function deactivate() {
  const running = client;
  client = undefined;
  await running?.stop();
}

module.exports = { activate, deactivate };
