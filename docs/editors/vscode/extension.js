const { workspace } = require("vscode");
const { LanguageClient } = require("vscode-languageclient/node");

let client;

exports.activate = () => {
  const settings = workspace.getConfiguration("multidrop");
  const server = { command: settings.get("command"), args: ["lsp"] };
  client = new LanguageClient("multidrop", "multidrop", server, {
    documentSelector: [{ language: "mcode" }, { language: "ascript" }, { language: "tmcl" }],
    initializationOptions: { personality: settings.get("personality") },
  });
  return client.start();
};

exports.deactivate = () => client && client.stop();
