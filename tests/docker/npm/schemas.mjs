// What the schemas of Kubernetes, KEDA and the Prometheus Operator say of documents:
// reads {NAME: DOCUMENT, ...} from standard input, writes {NAME: [PROBLEM, ...], ...}.
//
// Their validators find wrong types and missing fields, but not misspelt ones; those
// TypeScript finds, in the same document as a literal.
import {readFileSync, writeFileSync} from "node:fs";
import {fileURLToPath} from "node:url";
import ts from "typescript";

const PACKAGES = {
  "keda.sh": "@kubernetes-models/keda/",
  "monitoring.coreos.com": "@kubernetes-models/prometheus-operator/",
};

function moduleOf({apiVersion}) {
  return (PACKAGES[apiVersion.split("/")[0]] ?? "kubernetes-models/") + apiVersion;
}

async function invalid(document) {
  try {
    const Kind = (await import(moduleOf(document)))[document.kind];
    new Kind(document).validate();
    return [];
  } catch (error) {
    return [error.message];
  }
}

/** Returns the problems of each document, in their order. */
function misspelt(documents) {
  const file = fileURLToPath(new URL("documents.ts", import.meta.url));
  const lines = documents.flatMap(({apiVersion, kind, ...rest}, at) => [
    `import {${kind} as Kind${at}} from "${moduleOf({apiVersion})}";`,
    `new Kind${at}(${JSON.stringify(rest)});`,
  ]);
  writeFileSync(file, lines.join("\n"));
  const program = ts.createProgram([file], {
    strict: true, noEmit: true, skipLibCheck: true,
    module: ts.ModuleKind.NodeNext, types: [], lib: ["lib.es2022.d.ts"],
  });
  const problems = documents.map(() => []);
  for (const found of ts.getPreEmitDiagnostics(program)) {
    const text = ts.flattenDiagnosticMessageText(found.messageText, " ");
    if (found.file?.fileName !== file) throw new Error(text);
    const {line} = found.file.getLineAndCharacterOfPosition(found.start);
    problems[line >> 1].push(text);
  }
  return problems;
}

const input = JSON.parse(readFileSync(0, "utf8"));
const names = Object.keys(input);
const documents = Object.values(input);
const literal = misspelt(documents);
const output = {};
for (const [at, name] of names.entries()) {
  output[name] = [...(await invalid(documents[at])), ...literal[at]];
}
writeFileSync(1, JSON.stringify(output));
