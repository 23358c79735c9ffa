"""The image's settings and compose.yaml, judged by the real server."""

import json
import re
import unittest

import deployment
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
        lists = (ROOT / "packaging/CMakeLists.txt").read_text()
        sources = re.findall(r"configure_file\((\S+)", lists)
        self.assertGreater(len(sources), 2)
        for source in sources:
            top = source.startswith("${PROJECT_SOURCE_DIR}/")
            path = source.partition("/")[2] if top else f"packaging/{source}"
            with self.subTest(path=path):
                self.assertTrue(any(path == c or path.startswith(f"{c}/") for c in copied))
                self.assertIn("!" + path.partition("/")[0], allowed)

    def test_build_packages_are_those_above_the_tests(self):
        lines = (ROOT / "docker/packages.txt").read_text().splitlines()
        above = lines[: lines.index("# tests")]
        self.assertIn("libgrpc++-dev", above)
        self.assertNotIn("libgtest-dev", above)


class ComposeTest(unittest.TestCase):
    def setUp(self):
        [self.compose] = deployment.documents(ROOT / "docker/compose.yaml")
        [self.tls] = deployment.documents(ROOT / "docker/compose.tls.yaml")
        self.server = self.compose["services"]["server"]
        self.config = deployment.effective(IMAGE_CONFIG, self.server["environment"])

    def test_image_is_this_version(self):
        self.assertEqual(self.server["image"], f"isomatch-server:{deployment.project_version()}")

    def test_without_tls_the_ports_are_this_machines(self):
        for name, service in self.compose["services"].items():
            for mapping in service["ports"]:
                self.assertRegex(mapping, r"^127\.0\.0\.1:", name)
        self.assertEqual(
            self.server["ports"], [f"127.0.0.1:7443:{deployment.port(self.config['listen'])}"]
        )

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
        self.assertIs(self.server["read_only"], True)
        self.assertEqual(self.server["cap_drop"], ["ALL"])
        self.assertEqual(self.server["security_opt"], ["no-new-privileges:true"])
        self.assertEqual(self.server["volumes"], [f"data:{self.config['data-dir']}"])
        self.assertIn("data", self.compose["volumes"])

    def test_prometheus_asks_where_the_metrics_are(self):
        [scrape] = deployment.documents(ROOT / "docker/prometheus.yml")
        [job] = scrape["scrape_configs"]
        address = self.config["metrics-listen"]
        self.assertEqual(address.rsplit(":", 1)[0], "0.0.0.0")
        [targets] = [entry["targets"] for entry in job["static_configs"]]
        self.assertEqual(targets, [f"server:{deployment.port(address)}"])

    def test_mounted_files_are_there(self):
        for service in self.compose["services"].values():
            for volume in service["volumes"]:
                source = volume.split(":")[0]
                if source.startswith("./"):
                    self.assertTrue((ROOT / "docker" / source).exists(), source)

    def test_with_tls_the_server_needs_no_insecure(self):
        server = self.tls["services"]["server"]
        settings = {**self.server["environment"], **server["environment"]}
        config = deployment.effective(IMAGE_CONFIG, settings)
        self.assertEqual(config["insecure"], "false")
        self.assertEqual(config["insecure-metrics"], "true")
        [mount] = server["volumes"]
        folder = re.fullmatch(r"\./secrets:(.*):ro", mount).group(1)
        for key in ("tls-cert", "tls-key", "api-keys"):
            self.assertTrue(config[key].startswith(folder + "/"), config[key])


if __name__ == "__main__":
    deployment.main()
