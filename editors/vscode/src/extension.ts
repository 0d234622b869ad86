// Starts `thingc lsp` and connects it to VS Code. All features are implemented in the language server.
import { commands, window, workspace } from "vscode";
import type { ExtensionContext } from "vscode";
import { LanguageClient } from "vscode-languageclient/node";
import { findProgram } from "./program.mjs";

const DOCUMENTS = [
  { scheme: "file", pattern: "**/*.{yaml,yml,toml}" },
  { scheme: "file", language: "python" },
];
const WATCHED = "**/*.{yaml,yml,toml,py,lock.json}";

let client: LanguageClient | undefined;

export async function activate(context: ExtensionContext): Promise<void> {
  context.subscriptions.push(
    commands.registerCommand("thingc.restart", restart),
    workspace.onDidGrantWorkspaceTrust(restart),
    workspace.onDidChangeConfiguration((change) => change.affectsConfiguration("thingc") && restart()),
  );
  await restart();
}

export function deactivate(): Promise<void> | undefined {
  return client?.dispose();
}

async function restart(): Promise<void> {
  await client?.dispose().catch(() => undefined);
  const configured = workspace.getConfiguration("thingc").get<string[]>("command", []);
  const found = findProgram({
    words: configured, trusted: workspace.isTrusted, folders: (workspace.workspaceFolders ?? []).map((folder) => folder.uri.fsPath),
    path: process.env["PATH"] ?? "", windows: process.platform === "win32",
  });
  if (found === undefined) {
    client = undefined;
    const name = configured[0] ?? "thingc";
    await offerSettings(`This workspace is not trusted, and there is no \`${name}\` outside it. Install thingc, or set thingc.command in your user settings to its absolute path.`);
    return;
  }
  const { program, words, cwd } = found;
  const watcher = workspace.createFileSystemWatcher(WATCHED);
  client = new LanguageClient(
    "thingc", "thingc",
    { command: program, args: [...words, "lsp"], options: cwd === undefined ? {} : { cwd } },
    { documentSelector: DOCUMENTS, synchronize: { fileEvents: watcher }, initializationOptions: { trusted: workspace.isTrusted } },
  );
  try {
    await client.start();
  } catch (fault) {
    const reason = fault instanceof Error ? fault.message : fault;
    await offerSettings(
      `\`${[program, ...words].join(" ")} lsp\` failed to start (${reason}). Install it with \`pip install 'thingc[lsp]'\`, or set thingc.command.`,
    );
  }
}

async function offerSettings(message: string): Promise<void> {
  const choice = await window.showErrorMessage(message, "Open settings");
  if (choice !== undefined) await commands.executeCommand("workbench.action.openSettings", "thingc.command");
}
