// Parses PromQL by Prometheus' own grammar: reads [EXPRESSION, ...] from standard
// input, writes [{errors: NUMBER, metrics: [NAME, ...], labels: [NAME, ...]}, ...].
import {readFileSync, writeFileSync} from "node:fs";
import {parser} from "@prometheus-io/lezer-promql";

function parse(text) {
  const found = {errors: 0, metrics: [], labels: []};
  parser.parse(text).iterate({
    enter({type, from, to, node}) {
      if (type.isError) found.errors += 1;
      if (type.name === "Identifier" && node.parent.name === "VectorSelector") {
        found.metrics.push(text.slice(from, to));
      }
      if (type.name === "LabelName") found.labels.push(text.slice(from, to));
    },
  });
  return found;
}

writeFileSync(1, JSON.stringify(JSON.parse(readFileSync(0, "utf8")).map(parse)));
