"""docker/kubernetes: settings judged by the real server, and whether parts fit."""

import re
import unittest

import deployment
from deployment import ROOT

PROBES = ("startupProbe", "readinessProbe", "livenessProbe")


def manifests():
    """Returns the objects by kind; each kind is there once, but ConfigMaps by name."""
    found = {}
    for path in sorted((ROOT / "docker/kubernetes").glob("*.yaml")):
        for document in deployment.documents(path):
            kind = document["kind"]
            if kind == "ConfigMap":
                kind = document["metadata"]["name"]
            assert kind not in found, f"{path}: a second {kind}"
            found[kind] = document
    return found


class KubernetesTest(unittest.TestCase):
    def setUp(self):
        self.objects = manifests()
        self.spec = self.objects["StatefulSet"]["spec"]
        self.pod = self.spec["template"]["spec"]
        self.container, self.edge = self.pod["containers"]
        text = self.objects["isomatch-server"]["data"]["server.toml"]
        self.config = deployment.effective_text(text, {})

    def test_all_live_in_the_namespace(self):
        namespace = self.objects.pop("Namespace")["metadata"]["name"]
        for kind, thing in self.objects.items():
            self.assertEqual(thing["metadata"]["namespace"], namespace, kind)

    def expect_secret(self, container, folder):
        [mount] = [m for m in container["volumeMounts"] if m["mountPath"] == folder]
        [volume] = [v for v in self.pod["volumes"] if v["name"] == mount["name"]]
        self.assertIn("secret", volume)
        self.assertNotIn("subPath", mount)  # such a mount never changes

    def test_the_server_has_keys_and_the_edge_tls(self):
        self.assertEqual(self.config["insecure"], "false")
        self.assertEqual(self.config["insecure-metrics"], "true")
        folder, _, name = self.config["api-keys"].rpartition("/")
        self.assertEqual(name, "keys.txt")
        self.expect_secret(self.container, folder)
        text = (ROOT / "docker/edge/nginx.conf").read_text()
        self.expect_secret(self.edge, re.search(r"default (/run/\S+);", text).group(1))

    def test_the_edge_is_the_one_that_is_tested(self):
        listen = self.objects["isomatch-edge"]["data"]["listen.conf"]
        self.assertEqual(listen, (ROOT / "docker/edge/listen.tls.conf").read_text())
        [mount] = [m for m in self.edge["volumeMounts"] if m["name"] == "edge"]
        self.assertEqual(mount["mountPath"], f"/etc/isomatch-edge/{mount['subPath']}")

    def test_both_share_the_socket(self):
        folder = self.config["listen"].removeprefix("unix:").rpartition("/")[0]
        for container in (self.container, self.edge):
            [mount] = [m for m in container["volumeMounts"] if m["name"] == "socket"]
            self.assertEqual(mount["mountPath"], folder)

    def test_the_configuration_is_where_the_image_looks(self):
        [mount] = [m for m in self.container["volumeMounts"] if m["name"] == "config"]
        [volume] = [v for v in self.pod["volumes"] if v["name"] == "config"]
        self.assertEqual(mount["mountPath"], "/etc/isomatch")
        self.assertIn(volume["configMap"]["name"], self.objects)

    def test_every_mount_has_a_volume(self):
        volumes = [volume["name"] for volume in self.pod["volumes"]]
        volumes += [claim["metadata"]["name"] for claim in self.spec["volumeClaimTemplates"]]
        mounts = [m["name"] for c in self.pod["containers"] for m in c["volumeMounts"]]
        self.assertEqual(set(volumes), set(mounts))
        self.assertEqual(len(volumes), len(set(volumes)))

    def test_images_are_this_version(self):
        for name, container in (("server", self.container), ("edge", self.edge)):
            self.assertEqual(
                container["image"], f"isomatch-{name}:{deployment.project_version()}"
            )

    def test_memory_and_processors_fit_the_limits(self):
        limits = self.container["resources"]["limits"]
        budget = deployment.size(self.config["memory-budget"])
        self.assertGreater(budget, 0)
        self.assertLessEqual(budget, deployment.BUDGET_SHARE * deployment.size(limits["memory"]))
        self.assertEqual(self.container["resources"]["requests"]["memory"], limits["memory"])
        threads = int(self.config["workers"]) * int(self.config["threads-per-job"])
        self.assertEqual(threads, int(limits["cpu"]))

    def test_what_is_kept_fits_the_volume(self):
        [claim] = self.spec["volumeClaimTemplates"]
        kept = sum(
            deployment.size(self.config[key]) for key in ("blob-store-bytes", "prepared-store-bytes")
        )
        self.assertLess(kept, deployment.size(claim["spec"]["resources"]["requests"]["storage"]))
        [mount] = [m for m in self.container["volumeMounts"] if m["name"] == "data"]
        self.assertEqual(mount["mountPath"], self.config["data-dir"])

    def test_one_server_owns_the_volume(self):
        self.assertEqual(self.spec["replicas"], 1)

    def test_has_time_to_drain(self):
        drain = deployment.seconds(self.config["drain-timeout"])
        grace = self.pod["terminationGracePeriodSeconds"]
        stop = deployment.seconds(self.config["unresponsive-grace"])
        self.assertGreater(grace, drain + stop + deployment.LAST_SECONDS)

    def test_probes_ask_by_the_own_binary_for_longer_than_it_takes(self):
        for name in PROBES:
            probe = self.container[name]
            self.assertEqual(
                probe["exec"]["command"], ["/usr/bin/isomatch-server", "--health"], name
            )
            self.assertGreater(probe["timeoutSeconds"], 2, name)

    def test_pod_is_restricted(self):
        pod = self.pod["securityContext"]
        self.assertIs(pod["runAsNonRoot"], True)
        self.assertEqual((pod["runAsUser"], pod["fsGroup"]), (10001, 10001))
        self.assertEqual(pod["seccompProfile"], {"type": "RuntimeDefault"})
        for one in (self.container, self.edge):
            container = one["securityContext"]
            self.assertIs(container["allowPrivilegeEscalation"], False)
            self.assertIs(container["readOnlyRootFilesystem"], True)
            self.assertEqual(container["capabilities"], {"drop": ["ALL"]})
        self.assertIs(self.pod["automountServiceAccountToken"], False)
        labels = self.objects["Namespace"]["metadata"]["labels"]
        self.assertEqual(labels["pod-security.kubernetes.io/enforce"], "restricted")

    def test_ports_are_those_that_are_listened_on(self):
        listen = self.objects["isomatch-edge"]["data"]["listen.conf"]
        containers = (self.container, self.edge)
        ports = {p["name"]: p["containerPort"] for c in containers for p in c["ports"]}
        self.assertEqual(
            ports,
            {
                "grpc": int(re.search(r"^listen (\d+) ssl", listen, re.MULTILINE).group(1)),
                "metrics": deployment.port(self.config["metrics-listen"]),
            },
        )
        for entry in self.objects["Service"]["spec"]["ports"]:
            self.assertIn(entry["targetPort"], ports)
        for rule in self.objects["NetworkPolicy"]["spec"]["ingress"]:
            for entry in rule["ports"]:
                self.assertIn(entry["port"], ports)
        annotations = self.spec["template"]["metadata"]["annotations"]
        self.assertEqual(annotations["prometheus.io/port"], str(ports["metrics"]))

    def test_selectors_find_the_pod(self):
        labels = self.spec["template"]["metadata"]["labels"]
        self.assertEqual(self.spec["selector"]["matchLabels"], labels)
        self.assertEqual(self.objects["Service"]["spec"]["selector"], labels)
        self.assertEqual(
            self.objects["NetworkPolicy"]["spec"]["podSelector"]["matchLabels"], labels
        )
        self.assertEqual(self.spec["serviceName"], self.objects["Service"]["metadata"]["name"])

    def test_the_server_calls_nobody(self):
        policy = self.objects["NetworkPolicy"]["spec"]
        self.assertEqual(policy["policyTypes"], ["Ingress", "Egress"])
        self.assertEqual(policy["egress"], [])


if __name__ == "__main__":
    deployment.main()
