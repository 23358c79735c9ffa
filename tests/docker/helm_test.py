"""docker/helm/isomatch: what helm makes of it with several sets of values, judged by the
schemas of Kubernetes and others, by the real server, and by chart_checks.py."""

import copy
import functools
import json
import os
import pathlib
import re
import subprocess
import tempfile
import unittest

import yaml

import chart_checks
import deployment
from deployment import ROOT

HELM = os.environ.get("ISOMATCH_HELM", "")
CHART = ROOT / "docker/helm/isomatch"
SETS = sorted((ROOT / "tests/docker/values").glob("*.yaml"))


def helm(*arguments):
    with tempfile.TemporaryDirectory() as home:
        return subprocess.run(
            [HELM, *map(str, arguments)], env={"HOME": home, "PATH": os.environ["PATH"]},
            capture_output=True, text=True, timeout=60,
        )  # fmt: skip


def values_of(path):
    [values] = deployment.documents(path)
    return values


@functools.cache
def rendered_text(path):
    answer = helm("template", "isomatch", CHART, "--namespace", "isomatch", "--values", path)
    assert answer.returncode == 0, answer.stderr
    return answer.stdout


def rendered(path):
    """Returns documents that the caller may change."""
    return [document for document in yaml.safe_load_all(rendered_text(path)) if document]


def schema_problems(documents):
    return deployment.ask_node("schemas.mjs", documents)


def titled(prefix, documents):
    return {f"{prefix}: {d['kind']} {d['metadata']['name']}": d for d in documents}


def known_values(node, where=""):
    """Returns the paths of all properties of a schema."""
    found = set()
    for key, value in node.get("properties", {}).items():
        found |= {where + key} | known_values(value, f"{where}{key}.")
    return found


def refusal(*settings):
    """Returns what helm says against the least values with other settings."""
    flags = [flag for setting in settings for flag in ("--set", setting)]
    least = ROOT / "tests/docker/values/least.yaml"
    answer = helm("template", "isomatch", CHART, "--values", least, *flags)
    return answer.stderr if answer.returncode else ""


class RenderingTest(unittest.TestCase):
    def test_lint_finds_nothing(self):
        for path in SETS:
            answer = helm("lint", "--strict", CHART, "--values", path)
            self.assertEqual(answer.returncode, 0, answer.stdout + answer.stderr)

    def test_sets_are_the_least_the_most_and_others(self):
        self.assertEqual([path.stem for path in SETS], ["least", "most", "off", "url"])
        kinds = {document["kind"] for path in SETS for document in rendered(path)}
        texts = "".join(path.read_text() for path in (CHART / "templates").glob("*.*"))
        self.assertEqual(kinds, set(re.findall(r"^kind: (\w+)$", texts, re.MULTILINE)))

    def test_every_check_is_content(self):
        for path in SETS:
            with self.subTest(values=path.stem):
                found = list(chart_checks.problems(rendered(path), values_of(path)))
                self.assertEqual(found, [])

    def test_every_document_fits_its_schema(self):
        documents = {}
        for path in SETS:
            documents |= titled(path.stem, rendered(path))
        for path in sorted((ROOT / "docker/kubernetes").glob("*.yaml")):
            documents |= titled(path.name, deployment.documents(path))
        misspelt, wrong = (copy.deepcopy(documents["least: Deployment isomatch-worker"]) for _ in "ab")
        container = misspelt["spec"]["template"]["spec"]["containers"][0]
        container["readynessProbe"] = container.pop("readinessProbe")
        wrong["spec"]["template"]["spec"]["terminationGracePeriodSeconds"] = "60s"
        planted = schema_problems({"misspelt": misspelt, "wrong": wrong, **documents})
        self.assertIn("readynessProbe", " ".join(planted.pop("misspelt")))
        self.assertIn("terminationGracePeriodSeconds must be integer", " ".join(planted.pop("wrong")))
        self.assertEqual({name: found for name, found in planted.items() if found}, {})

    def test_each_object_is_there_once(self):
        for path in SETS:
            names = list(titled(path.stem, rendered(path)))
            documents = rendered(path)
            self.assertEqual(len(names), len(documents))

    def test_notes_tell_how_to_call(self):
        for path in SETS:
            flags = ["--dry-run=client", "--namespace", "meshes", "--values", path]
            said = helm("install", "isomatch", CHART, *flags).stdout.partition("\nNOTES:\n")[2]
            [port] = [d["spec"]["ports"][0]["port"] for d in rendered(path) if d["kind"] == "Service"]
            name = values_of(path).get("fullnameOverride", "isomatch")
            self.assertIn(f"{name}.meshes.svc:{port}", said)
            self.assertEqual("WARNING" in said, values_of(path).get("insecure", False))
            for words in re.findall(r"isomatch info (.*)", said):
                flags = re.findall(r"--[a-z-]+", words)
                known = subprocess.run([deployment.CLIENT, "info", "--help"], capture_output=True,
                                       text=True, check=True).stdout  # fmt: skip
                self.assertEqual([flag for flag in flags if flag not in known], [])


class ChartTest(unittest.TestCase):
    def test_it_is_this_version(self):
        [chart] = deployment.documents(CHART / "Chart.yaml")
        self.assertEqual(chart["appVersion"], deployment.project_version())
        self.assertEqual(chart["version"], deployment.project_version())

    def test_copies_are_those_of_docker(self):
        for copied, original in (("listen.conf", "edge/listen.tls.conf"), ("alerts.yml", "alerts.yml")):
            here, there = CHART / "files" / copied, ROOT / "docker" / original
            self.assertEqual(here.read_text(), there.read_text(), copied)

    def test_alerts_and_the_edge_arrive_as_they_are(self):
        documents = rendered(ROOT / "tests/docker/values/most.yaml")
        [rule] = [document for document in documents if document["kind"] == "PrometheusRule"]
        [alerts] = deployment.documents(ROOT / "docker/alerts.yml")
        self.assertEqual(rule["spec"], alerts)
        [listen] = [d["data"]["listen.conf"] for d in documents
                    if d["kind"] == "ConfigMap" and "listen.conf" in d["data"]]  # fmt: skip
        self.assertEqual(listen, (ROOT / "docker/edge/listen.tls.conf").read_text())

    def test_the_edge_is_where_nginx_looks(self):
        for path in SETS:
            [gateway] = [d for d in rendered(path) if d["metadata"]["name"].endswith("-gateway")
                         and d["kind"] == "Deployment"]  # fmt: skip
            server, edge = gateway["spec"]["template"]["spec"]["containers"]
            mounts = {mount["mountPath"]: mount["name"] for mount in edge["volumeMounts"]}
            [mount] = [m for m in server["volumeMounts"] if m["name"] == "socket"]
            self.assertEqual(mounts[mount["mountPath"]], "socket")
            has_tls = "tls" in values_of(path)
            self.assertEqual("/run/secrets/isomatch/tls" in mounts, has_tls)
            self.assertEqual("/etc/isomatch-edge/listen.conf" in mounts, has_tls)

    def test_the_database_of_the_manual_is_what_the_chart_wants(self):
        [cluster] = deployment.documents(ROOT / "docker/helm/cloudnative-pg.yaml")
        [values] = deployment.documents(CHART / "values.yaml")
        given = cluster["spec"]["postgresql"]["parameters"]
        self.assertEqual(given["autovacuum_naptime"], "5s")
        gateways = values["gateway"]["autoscaling"]["maxReplicas"] + 1  # one while it is exchanged
        workers = values["worker"]["keda"]["maxReplicas"] * 1.25
        needed = 20 * gateways + (20 + values["worker"]["jobs"]) * workers
        self.assertLess(needed, int(given["max_connections"]) - 10)
        url = values_of(ROOT / "tests/docker/values/url.yaml")["database"]["urlSecret"]["name"]
        self.assertEqual(url, f"{cluster['metadata']['name']}-app")

    def test_settings_of_all_give_way_to_those_of_a_role(self):
        path = ROOT / "tests/docker/values/most.yaml"
        [values] = deployment.documents(path)
        for deployed in chart_checks.of_kind(rendered(path), "Deployment"):
            role = chart_checks.component(deployed)
            settings = chart_checks.config(rendered(path), deployed)
            for flag, value in {**values["settings"], **values[role]["settings"]}.items():
                self.assertEqual(settings[flag], value, f"{role}: {flag}")

    def test_the_schema_has_every_value_and_no_other(self):
        schema = json.loads((CHART / "values.schema.json").read_text())
        [values] = deployment.documents(CHART / "values.yaml")

        def keys(thing, where=""):
            # Below `resources` and the like it is the user who names keys.
            if not isinstance(thing, dict) or where.endswith(("resources.", "settings.")):
                return set()
            return {where + key for key in thing}.union(
                *(keys(value, f"{where}{key}.") for key, value in thing.items())
            )

        self.assertEqual(keys(values), known_values(schema) - {"global"})

    def test_every_value_is_explained(self):
        schema = json.loads((CHART / "values.schema.json").read_text())
        lines = (CHART / "values.yaml").read_text().splitlines()
        path = []
        for before, line in zip(["", *lines], lines):
            if found := re.match(r"( *)(\w+):", line):
                path[len(found[1]) // 2 :] = [found[2]]
                if ".".join(path) in known_values(schema):
                    self.assertTrue(before.lstrip().startswith("#"), f"{path} has no comment")


class ValuesTest(unittest.TestCase):
    def test_wrong_values_are_refused(self):
        for setting, said in (
            ("worker.replica=3", "'replica' not allowed"),
            ("workers.jobs=3", "'workers' not allowed"),
            ("worker.jobs=many", "got string, want integer"),
            ("worker.jobs=0", "minimum"),
            ("worker.settings.drain-timeout=5s", "invalid propertyName 'drain-timeout'"),
            ("settings.blob-dir=/blobs", "invalid propertyName 'blob-dir'"),
            ("blobs.readOnly=yes", "want boolean"),
            ("gateway.settings.max_jobs=5", "invalid propertyName 'max_jobs'"),
            ("gateway.settings.max-queued-jobs=5", "want string"),
            ("image.tag=latest", "image/tag"),
            ("database.sslMode=maybe", "sslMode"),
            ("database.password=secret", "want object"),
            ("networkPolicy.clients=null", "missing property 'clients'"),
            ("networkPolicy.clients=[]", "clients"),
            ("service.type=ExternalName", "service/type"),
        ):
            with self.subTest(setting=setting):
                self.assertRegex(refusal(setting), rf"(?s)values don't meet.*{said}")

    def test_what_has_to_be_said_is_asked_for(self):
        for setting, said in (
            ("database.host=", "expected database.host, or database.urlSecret.name"),
            ("tls.secretName=", "expected tls.secretName and apiKeys.secretName, or insecure"),
            ("apiKeys.secretName=", "expected tls.secretName and apiKeys.secretName, or insecure"),
            ("database.sslMode=verify-full", "expected database.ca.secretName"),
            ("blobs.readOnly=true", "expected blobs.claimName"),
            ("gateway.autoscaling.minReplicas=9", "expected gateway.autoscaling.minReplicas of at"),
        ):
            with self.subTest(setting=setting):
                self.assertIn(said, refusal(setting))
        self.assertIn("worker.keda.minReplicas", refusal(
            "worker.keda.enabled=true", "worker.keda.minReplicas=21"))  # fmt: skip
        self.assertEqual(refusal(), "")
        self.assertEqual(refusal("tls.secretName=", "insecure=true"), "")


def parts(documents):
    """Returns workloads and others by component or kind, to plant faults in."""
    found = {}
    for document in documents:
        labels = document["metadata"]["labels"]
        component = labels["app.kubernetes.io/component"]
        found[f"{document['kind']} {component}"] = document
    return found


def pod(document):
    return document["spec"]["template"]["spec"]


# Check -> what breaks the rendering of most.yaml so that it has to say so.
FAULTS = {
    "probe_problems": lambda p: pod(p["Deployment worker"])["containers"][0]["livenessProbe"]
        .update(httpGet={"path": "/readyz", "port": "metrics"}),
    "grace_problems": lambda p: pod(p["Deployment worker"]).update(terminationGracePeriodSeconds=610),
    "budget_problems": lambda p: p["PodDisruptionBudget worker"]["spec"].update(
        selector={"matchLabels": {"app.kubernetes.io/component": "workers"}}),
    "selector_problems": lambda p: p["Service gateway"]["spec"]["selector"].update(
        {"app.kubernetes.io/component": "edge"}),
    "scaling_problems": lambda p: p["ScaledObject worker"]["spec"]["triggers"][0]["metadata"].update(
        query="SELECT count(*) FROM isomatch.live_jobs WHERE state = 1"),
    "mount_problems": lambda p: pod(p["Deployment gateway"])["volumes"].pop(),
    "security_problems": lambda p: pod(p["Job migration"])["containers"][0]["securityContext"].update(
        readOnlyRootFilesystem=False),
    "server_problems": lambda p: pod(p["Deployment worker"])["containers"][0]["env"].append(
        {"name": "ISOMATCH_ROLE", "value": "gateway"}),
    "file_problems": lambda p: pod(p["Deployment worker"])["containers"][0]["volumeMounts"].pop(),
    "reference_problems": lambda p: pod(p["Deployment worker"])["volumes"][-1]["secret"].update(
        secretName="other"),
    "image_problems": lambda p: pod(p["Job migration"])["containers"][0].update(
        image="isomatch-server:latest"),
    "blob_problems": lambda p: pod(p["Deployment worker"])["containers"][0]["env"].append(
        {"name": "ISOMATCH_BLOB_DIR_READ_ONLY", "value": "false"}),
    "policy_problems": lambda p: p["NetworkPolicy worker"]["spec"]["ingress"].append(
        {"ports": [{"port": "grpc"}]}),
    "hook_problems": lambda p: pod(p["Job migration"]).update(serviceAccountName="meshes"),
}  # fmt: skip


class FaultsTest(unittest.TestCase):
    def test_every_check_can_fail(self):
        path = ROOT / "tests/docker/values/most.yaml"
        checks = {check.__name__: check for check in chart_checks.CHECKS}
        with_values = {check.__name__: check for check in chart_checks.CHECKS_WITH_VALUES}
        self.assertEqual(set(FAULTS), set(checks) | set(with_values))
        for name, plant in FAULTS.items():
            documents = rendered(path)
            plant(parts(documents))
            with self.subTest(check=name):
                if name in checks:
                    self.assertNotEqual(list(checks[name](documents)), [])
                else:
                    self.assertNotEqual(list(with_values[name](documents, values_of(path))), [])

    def test_each_part_of_the_folder_for_blobs_is_missed(self):
        path = ROOT / "tests/docker/values/most.yaml"
        for role in ("gateway", "worker"):
            for part in ("env", "volumeMounts", "volumes"):
                documents = rendered(path)
                spec = pod(parts(documents)[f"Deployment {role}"])
                entries = spec[part] if part in spec else spec["containers"][0][part]
                kept = [entry for entry in entries if "blob" not in entry["name"].lower()]
                with self.subTest(role=role, part=part):
                    self.assertLess(len(kept), len(entries))
                    entries[:] = kept
                    found = list(chart_checks.blob_problems(documents, values_of(path)))
                    self.assertTrue(found and all(f"meshes-{role}:" in one for one in found), found)

    def test_a_folder_for_blobs_that_nobody_asked_for_is_found(self):
        documents = rendered(ROOT / "tests/docker/values/url.yaml")
        found = list(chart_checks.blob_problems(documents, {}))
        self.assertEqual([one.split(":")[0] for one in found], ["isomatch-gateway", "isomatch-worker"])


if __name__ == "__main__":
    assert pathlib.Path(HELM).is_file(), "set ISOMATCH_HELM, as ctest does"
    deployment.main()
