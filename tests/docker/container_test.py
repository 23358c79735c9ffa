"""The image's settings and compose.yaml, judged by the real server."""

import json
import re
import unittest

import compose
import deployment
from compose import edge_port, edge_socket, edge_text, published
from deployment import IMAGE_CONFIG, ROOT

HEALTH = ["/usr/bin/isomatch-server", "--health"]


def instructions():
    """Returns the instructions of the last stage of docker/Dockerfile, by name."""
    text = (ROOT / "docker/Dockerfile").read_text().replace("\\\n", " ")
    last = text[text.rindex("\nFROM ") :]
    found = {}
    for line in last.splitlines():
        name, _, rest = line.partition(" ")
        if name.isupper():
            found.setdefault(name, []).append(" ".join(rest.split()))
    return found


class ImageTest(unittest.TestCase):
    def test_does_not_start_open_to_the_network_by_itself(self):
        answer = deployment.ask_server(["--config", str(IMAGE_CONFIG), "--print-config"], {})
        self.assertEqual(answer.returncode, 2)
        self.assertIn("API keys", answer.stderr)

    def test_listens_on_the_exposed_ports_and_writes_to_the_volume(self):
        config = deployment.effective(IMAGE_CONFIG, {"ISOMATCH_INSECURE": "true"})
        image = instructions()
        ports = {deployment.port(config["listen"]), deployment.port(config["metrics-listen"])}
        self.assertEqual({int(port) for port in image["EXPOSE"][0].split()}, ports)
        self.assertEqual(image["VOLUME"], [config["data-dir"]])
        self.assertTrue(any(copy.endswith(" /run/isomatch") for copy in image["COPY"]))
        self.assertEqual(image["ENV"], ["ISOMATCH_CONFIG=/etc/isomatch/server.toml"])

    def test_runs_as_a_user_and_asks_the_server_for_its_health(self):
        image = instructions()
        self.assertEqual(image["USER"], ["10001:10001"])
        self.assertEqual(image["STOPSIGNAL"], ["SIGTERM"])
        options, _, command = image["HEALTHCHECK"][0].partition("CMD ")
        self.assertEqual(json.loads(command), HEALTH)
        self.assertIn("--timeout=5s", options)  # --health itself takes 2 s at most
        self.assertEqual([json.loads(entry) for entry in image["ENTRYPOINT"]], [HEALTH[:1]])

    def test_what_cmake_configures_is_in_the_build(self):
        copied = [
            path
            for line in (ROOT / "docker/Dockerfile").read_text().splitlines()
            if line.startswith("COPY ")
            for path in line.split()[1:-1]
        ]
        allowed = (ROOT / ".dockerignore").read_text().splitlines()
        lists = (ROOT / "docker/debian/CMakeLists.txt").read_text()
        sources = re.findall(r"configure_file\((\S+)", lists)
        self.assertGreater(len(sources), 2)
        for source in sources:
            top = source.startswith("${PROJECT_SOURCE_DIR}/")
            path = source.partition("/")[2] if top else f"docker/debian/{source}"
            with self.subTest(path=path):
                self.assertTrue(any(path == c or path.startswith(f"{c}/") for c in copied))
                self.assertIn("!" + path.partition("/")[0], allowed)

    def test_build_packages_are_those_above_the_tests(self):
        lines = (ROOT / "docker/packages.txt").read_text().splitlines()
        above = lines[: lines.index("# tests")]
        self.assertIn("libgrpc++-dev", above)
        self.assertNotIn("libgtest-dev", above)


class EdgeImageTest(unittest.TestCase):
    def test_says_what_the_configuration_says(self):
        text = (ROOT / "docker/edge/Dockerfile").read_text()
        self.assertIn(f"EXPOSE {edge_port('listen.conf')}\n", text)
        self.assertEqual(edge_port("listen.conf"), edge_port("listen.tls.conf"))
        self.assertIn("USER 10001:10001\n", text)
        self.assertIn(f"/socket {edge_socket().rpartition('/')[0]}\n", text)
        self.assertIn('"-c", "/etc/isomatch-edge/nginx.conf"]', text)
        for name in ("listen.conf", "servers.conf"):
            self.assertIn(f"include /etc/isomatch-edge/{name};", edge_text("nginx.conf"))
            self.assertIn(f"docker/edge/{name} ", text)


class ComposeTest(unittest.TestCase):
    def setUp(self):
        [self.compose] = deployment.documents(ROOT / "docker/compose.yaml")
        [self.tls] = deployment.documents(ROOT / "docker/compose.tls.yaml")
        self.server = self.compose["services"]["server"]
        self.edge = self.compose["services"]["edge"]
        self.config = deployment.effective(IMAGE_CONFIG, self.server["environment"])

    def test_images_are_this_version(self):
        for name, service in (("isomatch-server", self.server), ("isomatch-edge", self.edge)):
            self.assertEqual(service["image"], f"{name}:{deployment.project_version()}")

    def test_without_tls_the_ports_are_this_machines(self):
        for name, service in self.compose["services"].items():
            for address, _, _ in published(service, {}):
                self.assertEqual(address, "127.0.0.1", name)

    def test_the_server_is_reached_through_the_edge_only(self):
        self.assertNotIn("ports", self.server)
        port = int(edge_port("listen.conf"))
        self.assertEqual(published(self.edge, {}), [("127.0.0.1", 7443, port)])
        self.assertEqual(self.config["listen"], f"unix:{edge_socket()}")
        self.assertEqual(self.config["insecure"], "false")
        folder = edge_socket().rpartition("/")[0]
        for service in (self.server, self.edge):
            self.assertIn(f"socket:{folder}", service["volumes"])

    def test_memory_budget_fits_the_container(self):
        budget = deployment.size(self.config["memory-budget"])
        most = deployment.BUDGET_SHARE * deployment.size(self.server["mem_limit"])
        self.assertGreater(budget, 0)
        self.assertLessEqual(budget, most)

    def test_has_time_to_drain(self):
        drain = deployment.seconds(self.config["drain-timeout"])
        grace = deployment.seconds(self.server["stop_grace_period"])
        stop = deployment.seconds(self.config["unresponsive-grace"])
        self.assertGreater(grace, drain + stop + deployment.LAST_SECONDS)

    def test_root_is_read_only_and_privileges_are_dropped(self):
        for service in (self.server, self.edge):
            self.assertIs(service["read_only"], True)
            self.assertEqual(service["cap_drop"], ["ALL"])
            self.assertEqual(service["security_opt"], ["no-new-privileges:true"])
        self.assertIn(f"data:{self.config['data-dir']}", self.server["volumes"])
        self.assertLessEqual({"data", "socket"}, set(self.compose["volumes"]))

    def test_the_edge_may_open_what_it_opens(self):
        text = edge_text("nginx.conf")
        files = int(re.search(r"worker_rlimit_nofile (\d+);", text).group(1))
        connections = int(re.search(r"worker_connections (\d+);", text).group(1))
        self.assertGreater(files, 2 * connections)
        self.assertEqual(self.edge["ulimits"]["nofile"], files)

    def test_prometheus_asks_where_the_metrics_are(self):
        [scrape] = deployment.documents(ROOT / "docker/prometheus.yml")
        [job] = scrape["scrape_configs"]
        address = self.config["metrics-listen"]
        self.assertEqual(address.rsplit(":", 1)[0], "0.0.0.0")
        [targets] = [entry["targets"] for entry in job["static_configs"]]
        self.assertEqual(targets, [f"server:{deployment.port(address)}"])

    def test_mounted_files_are_there(self):
        for service in self.compose["services"].values():
            for volume in service.get("volumes", []):
                source = volume.split(":")[0]
                if source.startswith("./"):
                    self.assertTrue((ROOT / "docker" / source).exists(), source)

    def test_with_tls_files_are_where_both_look(self):
        server, edge = (self.tls["services"][name] for name in ("server", "edge"))
        settings = {**self.server["environment"], **server["environment"]}
        config = deployment.effective(IMAGE_CONFIG, settings)
        self.assertEqual(config["insecure"], "false")
        [keys] = server["volumes"]
        listen, tls = edge["volumes"]
        self.assertEqual(
            listen, "./edge/listen.tls.conf:/etc/isomatch-edge/listen.conf:ro"
        )
        self.assertEqual(
            config["api-keys"].rpartition("/")[0],
            re.fullmatch(r"\./secrets/api-keys:(.*):ro", keys).group(1),
        )
        folder = re.fullmatch(r"\./secrets/tls:(.*):ro", tls).group(1)
        self.assertIn(f"default {folder};", edge_text("nginx.conf"))

    def test_with_tls_the_port_is_published_once(self):
        [command] = re.findall(
            r"^#   export ISOMATCH_PUBLISH=(\S+)$",
            (ROOT / "docker/compose.tls.yaml").read_text(),
            re.MULTILINE,
        )
        services = compose.running(compose.merged(self.compose, self.tls)["services"])
        port = int(edge_port("listen.tls.conf"))
        self.assertEqual(services["edge"]["volumes"][1:], self.tls["services"]["edge"]["volumes"])
        for publish, address in ((command, ""), ("", "127.0.0.1")):
            variables = {"ISOMATCH_PUBLISH": publish}
            self.assertEqual(published(services["edge"], variables), [(address, 7443, port)])
            taken = [
                outside
                for service in services.values()
                for _, outside, _ in published(service, variables)
            ]
            self.assertEqual(len(taken), len(set(taken)))


if __name__ == "__main__":
    deployment.main()
