// Starts `thingc lsp` and hands everything on; all that is known of robots is known there.
import { existsSync } from "node:fs";
import { join } from "node:path";
import { commands, window, workspace } from "vscode";
import type { ExtensionContext } from "vscode";
import { LanguageClient } from "vscode-languageclient/node";

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

/** What starts thingc: as it is set, else of the folder's own environment, but only where the folder is trusted, for that runs it. */
function command(): string[] {
  const words = workspace.getConfiguration("thingc").get<string[]>("command", []);
  if (words.length > 0) return words;
  const own = process.platform === "win32" ? "Scripts/thingc.exe" : "bin/thingc";
  const places = workspace.isTrusted ? (workspace.workspaceFolders ?? []).map((folder) => join(folder.uri.fsPath, ".venv", own)) : [];
  return [places.find((place) => existsSync(place)) ?? "thingc"];
}

async function restart(): Promise<void> {
  await client?.dispose().catch(() => undefined);
  const [program = "thingc", ...words] = command();
  const watcher = workspace.createFileSystemWatcher(WATCHED);
  client = new LanguageClient(
    "thingc", "thingc",
    { command: program, args: [...words, "lsp"], options: { cwd: workspace.workspaceFolders?.[0]?.uri.fsPath } },
    { documentSelector: DOCUMENTS, synchronize: { fileEvents: watcher }, initializationOptions: { trusted: workspace.isTrusted } },
  );
  try {
    await client.start();
  } catch (fault) {
    const choice = await window.showErrorMessage(
      `\`${[program, ...words].join(" ")} lsp\` does not start (${fault instanceof Error ? fault.message : fault}). Install it with \`pip install 'thingc[lsp]'\`, or say under thingc.command where it is.`,
      "Open settings",
    );
    if (choice !== undefined) await commands.executeCommand("workbench.action.openSettings", "thingc.command");
  }
}
