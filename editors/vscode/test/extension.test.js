// The bundle, with a stand-in for VS Code and a real language server (SYMCHECK_LSP, or the PATH).
const assert = require("node:assert");
const fs = require("node:fs");
const os = require("node:os");
const path = require("node:path");
const test = require("node:test");
const { load, CancellationTokenSource } = require("./stub.js");

const SERVER = process.env.SYMCHECK_LSP ?? "symcheck-lsp";
const MODELS = path.join(__dirname, "../../../models/modelling");

async function until(holds) {
  for (let i = 0; i < 600; i++) {
    const found = await holds();
    if (found) return found;
    await new Promise((go) => setTimeout(go, 50));
  }
  assert.fail("nothing came");
}

const copied = () => {
  const folder = fs.mkdtempSync(path.join(os.tmpdir(), "symcheck-"));
  fs.cpSync(MODELS, folder, { recursive: true });
  return folder;
};

test("a missing server is named, with what helps", async () => {
  const seen = load({ "symcheck.server.path": "no-such-server" });
  await seen.extension.activate({ subscriptions: [] });
  assert.match(seen.errors[0], /no-such-server.*pip install '\.\[lsp\]'.*symcheck\.server\.path/);
  await seen.extension.deactivate();
});

test("faults come from the server, and a property is checked", async () => {
  const folder = copied();
  const seen = load({ "symcheck.server.path": SERVER });
  await seen.extension.activate({ subscriptions: [] });
  try {
    const model = fs.readFileSync(path.join(folder, "printer.pm"), "utf8");
    const faulty = seen.open(path.join(folder, "faulty.prism"), "prism", model.replace("state=1 ->", "stat=1 ->"));
    const [fault] = await until(() => seen.faults[faulty.uri.toString()]);
    assert.match(fault.message, /stat/);

    const text = fs.readFileSync(path.join(folder, "printer.pctl"), "utf8");
    const asked = seen.open(path.join(folder, "printer.pctl"), "prism-properties", text);
    const lenses = () => seen.lenses[0].provideCodeLenses(asked, new CancellationTokenSource().token);
    const [lens] = await until(async () => (await lenses())?.length && lenses());
    assert.strictEqual(lens.command.title, "check");
    seen.vscode.window.activeTextEditor = { document: asked, selection: { active: lens.range.start } };
    const answer = await seen.commands["symcheck.checkHere"]();
    assert.match(answer, /^0\.1176470588235/);
    assert.deepStrictEqual(seen.status, [`symcheck: ${answer}`]);
    assert.strictEqual((await lenses())[0].command.title, answer);
  } finally {
    await seen.extension.deactivate();
    fs.rmSync(folder, { recursive: true });
  }
});

test("constants of a check come from the settings, which are described", async () => {
  const folder = copied();
  const seen = load({ "symcheck.server.path": SERVER });
  await seen.extension.activate({ subscriptions: [] });
  try {
    const model = "dtmc const int N; module m x : [0..N]; [] x<N -> (x'=x+1); endmodule";
    fs.writeFileSync(path.join(folder, "count.prism"), model);
    const asked = seen.open(path.join(folder, "count.pctl"), "prism-properties", "P=? [ F x=N ]");
    const lenses = () => seen.lenses[0].provideCodeLenses(asked, new CancellationTokenSource().token);
    const [lens] = await until(async () => (await lenses())?.length && lenses());
    seen.vscode.window.activeTextEditor = { document: asked, selection: { active: lens.range.start } };
    assert.match(await seen.commands["symcheck.checkHere"](), /N without a value: set symcheck\.constants to N=/);
    seen.settings["symcheck.constants"] = "N=7";
    assert.match(await seen.commands["symcheck.checkHere"](), /^1\.0 .*, N=7$/);
  } finally {
    await seen.extension.deactivate();
    fs.rmSync(folder, { recursive: true });
  }
  const { properties } = require("../package.json").contributes.configuration;
  const readme = fs.readFileSync(path.join(__dirname, "../README.md"), "utf8");
  for (const name of Object.keys(properties)) assert.ok(readme.includes(`\`${name}\``), name);
});

test(".pm and .props are claimed for a workspace, by a command", async () => {
  const seen = load({ "symcheck.server.path": "no-such-server", "files.associations": { "*.a": "b" } });
  await seen.extension.activate({ subscriptions: [] });
  await seen.commands["symcheck.claim"]();
  const wanted = { "*.a": "b", "*.pm": "prism", "*.props": "prism-properties" };
  assert.deepStrictEqual(seen.updates, [["files", "associations", wanted, 2]]);
  const { languages } = require("../package.json").contributes;
  const claimed = languages.flatMap((l) => l.extensions);
  assert.ok(!claimed.includes(".pm") && !claimed.includes(".props"));
});
