"""What the Grafana dashboard asks for is what a server exports that has matched."""

import contextlib
import importlib.machinery
import importlib.util
import json
import pathlib
import re
import signal
import subprocess
import tempfile
import unittest
import urllib.request

import deployment
from deployment import ROOT

# Prometheus itself has it for every target, with the labels of docker/prometheus.yml.
BUILT_IN = {"up": {"job", "role"}}


def read_until(server, pattern):
    for line in server.stderr:
        found = re.search(pattern, line)
        if found:
            return found.group(1)
    raise RuntimeError(f"the server never said {pattern}")


@contextlib.contextmanager
def database(folder):
    """The URL of a PostgreSQL of its own, with tables."""
    loader = importlib.machinery.SourceFileLoader("cluster", str(ROOT / "scripts/cluster"))
    cluster = importlib.util.module_from_spec(importlib.util.spec_from_loader("cluster", loader))
    loader.exec_module(cluster)
    postgres = cluster.Database(folder)
    with subprocess.Popen(postgres.command(), stderr=subprocess.DEVNULL) as process:
        try:
            postgres.create()
            subprocess.run([deployment.SERVER, "migrate", "--store", postgres.url], check=True)
            yield postgres.url
        finally:
            process.send_signal(signal.SIGQUIT)


def metrics_after_a_job():
    """Returns each exported sample's name with the labels it was seen with."""
    with tempfile.TemporaryDirectory() as folder, database(pathlib.Path(folder)) as store:
        return metrics_of_server(store)


def metrics_of_server(store):
    free_ports = {"ISOMATCH_LISTEN": "127.0.0.1:0", "ISOMATCH_METRICS_LISTEN": "127.0.0.1:0"}
    with subprocess.Popen(
        [deployment.SERVER, "--store", store],
        env=deployment.environment(free_ports),
        stderr=subprocess.PIPE,
        text=True,
    ) as server, tempfile.TemporaryDirectory() as folder:
        try:
            address = read_until(server, r"listens on (\S+)")
            metrics = read_until(server, r"metrics: (\S+)")
            match_pair(pathlib.Path(folder), address)
            text = urllib.request.urlopen(metrics, timeout=10).read().decode()
        finally:
            server.send_signal(signal.SIGTERM)
    found = {}
    for name, labels in re.findall(r"^(\w+)(?:\{(.*)\})? \S+$", text, re.MULTILINE):
        found.setdefault(name, set()).update(re.findall(r'(\w+)="', labels))
    return found


def match_pair(folder, address):
    def isomatch(*arguments):
        subprocess.run([deployment.CLIENT, *arguments], check=True, capture_output=True)

    x, y = folder / "x.off", folder / "y.off"
    isomatch("sample", "--pose", "A", "--vertices", "400", "-o", x)
    isomatch("sample", "--pose", "B", "--vertices", "400", "-o", y)
    isomatch("match", "--server", address, x, y, "-o", folder / "map.txt")


def expressions():
    path = ROOT / "docker/grafana/dashboards/isomatch.json"
    for panel in json.loads(path.read_text())["panels"]:
        for target in panel.get("targets", []):  # a row has none
            yield panel["title"], target["expr"], target["legendFormat"]


class DashboardTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.exported = {**BUILT_IN, **metrics_after_a_job()}

    def test_metrics_are_exported(self):
        for title, expression, _ in expressions():
            names = re.findall(r"\b(isomatch_\w+|up)\b", expression)
            self.assertTrue(names, title)
            for name in names:
                self.assertIn(name, self.exported, title)

    def test_metrics_of_a_cluster_are_what_other_tests_take_them_for(self):
        self.assertEqual(set(deployment.CLUSTER_METRICS) - set(self.exported), set())

    def test_labels_are_those_of_the_metric(self):
        for title, expression, legend in expressions():
            labels = set(re.findall(r"\{\{(\w+)\}\}", legend))
            labels |= set(re.findall(r'(\w+)="', expression))
            for group in re.findall(r"by \(([^)]*)\)", expression):
                labels |= set(group.split(", "))
            names = re.findall(r"\b(isomatch_\w+|up)\b", expression)
            for name in names:
                self.assertLessEqual(labels, self.exported[name], f"{title}: {name}")

    def test_every_documented_metric_is_exported(self):
        table = (ROOT / "server/README.md").read_text().split("## Metrics")[1].split("\n## ")[0]
        rows = re.findall(r"^\| (`.*?) \| (?:gauge|counter|histogram) ", table, re.MULTILINE)
        documented = {name for row in rows for name in re.findall(r"`(\w+)`", row)}
        self.assertGreater(len(documented), 15)
        exported = {re.sub("_(bucket|sum|count)$", "", name) for name in self.exported}
        self.assertEqual({f"isomatch_{name}" for name in documented} - exported, set())

    def test_every_exported_metric_is_on_the_dashboard(self):
        shown = " ".join(expression for _, expression, _ in expressions())
        for name in self.exported:
            family = re.sub("_(bucket|sum|count)$", "", name)
            if family.startswith("isomatch_"):
                self.assertIn(family, shown)

    def test_datasource_is_the_provisioned_one(self):
        folder = ROOT / "docker/grafana"
        [provisioned] = deployment.documents(folder / "provisioning/datasources/prometheus.yaml")
        [source] = provisioned["datasources"]
        dashboard = json.loads((folder / "dashboards/isomatch.json").read_text())
        for panel in dashboard["panels"]:
            if panel["type"] == "row":
                continue
            self.assertEqual(panel["datasource"]["uid"], source["uid"], panel["title"])
        [compose] = deployment.documents(ROOT / "docker/compose.yaml")
        host, number = re.fullmatch(r"http://(\w+):(\d+)", source["url"]).groups()
        self.assertIn(f"127.0.0.1:9090:{number}", compose["services"][host]["ports"])


if __name__ == "__main__":
    deployment.main()
