"""docker/alerts.yml and the dashboard's PromQL, parsed by Prometheus' own grammar."""

import json
import re
import unittest

import deployment
from deployment import ROOT

# What Prometheus puts in place of Grafana's variable.
INTERVAL = ("[$__rate_interval]", "[1m]")
COUNTERS = {name for name in deployment.CLUSTER_METRICS if name.endswith("_total")}


def alerts():
    [document] = deployment.documents(ROOT / "docker/alerts.yml")
    [group] = document["groups"]
    return group["rules"]


def parsed(expressions):
    return deployment.ask_node("promql.mjs", expressions)


def metric_problems(expression, found, known):
    """Yields what is wrong with a parsed expression."""
    if found["errors"] or not found["metrics"]:
        yield f"{expression}: is no PromQL about a metric"
    for name in found["metrics"]:
        if name not in known:
            yield f"{expression}: nobody exports {name}"
        rates = re.findall(rf"(?:rate|increase)\({name}\b", expression)
        if (name in COUNTERS) != bool(rates):
            yield f"{expression}: {name} is counted, or it is not, but not as here"


def summary_problems(alert):
    """Yields what an alert does not say to the person whom it wakes up."""
    notes = alert.get("annotations", {})
    if set(notes) != {"summary", "runbook"}:
        yield f"{alert['alert']} says {sorted(notes)}, expected summary and runbook"
    for key, text in notes.items():
        if not re.match(r"^[A-Z{].*\.$", text) or "\n" in text:
            yield f"{alert['alert']}: {key} is no sentence in one line: {text}"
    if alert.get("labels", {}).get("severity") not in ("warning", "critical"):
        yield f"{alert['alert']} is neither a warning nor critical"


class AlertsTest(unittest.TestCase):
    def test_each_is_about_metrics_that_are_exported(self):
        known = {"up", *deployment.CLUSTER_METRICS}
        texts = [alert["expr"] for alert in alerts()]
        for text, found in zip(texts, parsed(texts)):
            self.assertEqual(list(metric_problems(text, found, known)), [])
            self.assertLessEqual(set(found["labels"]), {"job", "role"}, text)

    def test_each_has_a_summary_and_a_runbook(self):
        for alert in alerts():
            self.assertEqual(list(summary_problems(alert)), [])

    def test_there_is_one_for_each_trouble(self):
        names = [alert["alert"] for alert in alerts()]
        self.assertEqual(len(names), len(set(names)))
        asked = " ".join(alert["expr"] for alert in alerts())
        for metric in ("queue_oldest_seconds", "leases_expired_total", "database_up", "dead_rows",
                       "oldest_transaction_seconds", "cluster_jobs_queued"):  # fmt: skip
            self.assertIn(metric, asked)

    def test_roles_are_those_that_prometheus_gives(self):
        [scrape] = deployment.documents(ROOT / "docker/prometheus.yml")
        [job] = scrape["scrape_configs"]
        given = {entry["labels"]["role"] for entry in job["static_configs"]}
        given |= {name for entry in job["dns_sd_configs"] for name in entry["names"]}
        self.assertEqual(given, {"all", "gateway", "worker"})
        self.assertTrue(all(f'job="{job["job_name"]}"' in a["expr"] for a in alerts() if "up{" in a["expr"]))

    def test_prometheus_loads_them(self):
        [scrape] = deployment.documents(ROOT / "docker/prometheus.yml")
        [compose] = deployment.documents(ROOT / "docker/compose.yaml")
        [file] = scrape["rule_files"]
        mounts = compose["services"]["prometheus"]["volumes"]
        self.assertIn(f"./{file}:/etc/prometheus/{file}:ro", mounts)
        self.assertIn("./prometheus.yml:/etc/prometheus/prometheus.yml:ro", mounts)

    def test_the_checks_can_fail(self):
        known = {"isomatch_claims_total", "up"}
        for text in ("max(up", "isomatch_claim_total > 1", "isomatch_claims_total > 1", "1 > 2"):
            [found] = parsed([text])
            self.assertNotEqual(list(metric_problems(text, found, known)), [], text)
        good = alerts()[0]
        for change in ({"annotations": {"summary": "It is old."}}, {"labels": {"severity": "bad"}},
                       {"annotations": {"summary": "old", "runbook": "Wait."}}):  # fmt: skip
            self.assertNotEqual(list(summary_problems({**good, **change})), [])


class DashboardTest(unittest.TestCase):
    def test_every_expression_is_promql(self):
        dashboard = json.loads((ROOT / "docker/grafana/dashboards/isomatch.json").read_text())
        texts = [target["expr"].replace(*INTERVAL) for panel in dashboard["panels"]
                 for target in panel.get("targets", [])]  # fmt: skip
        self.assertGreater(len(texts), 30)
        for text, found in zip(texts, parsed(texts)):
            self.assertEqual(found["errors"], 0, text)


if __name__ == "__main__":
    deployment.main()
