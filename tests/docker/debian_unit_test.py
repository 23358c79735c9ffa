"""docker/debian/: the unit and its settings, judged by the real server."""

import re
import unittest

import deployment
from deployment import ROOT

CONFIG = ROOT / "docker/debian/server.toml"


def unit():
    """Returns the settings of the unit's [Service]; the last of a name holds."""
    text = (ROOT / "docker/debian/isomatch-server.service.in").read_text()
    service = text.split("[Service]")[1].split("[Install]")[0]
    return dict(re.findall(r"^(\w+)=(.*)$", service, re.MULTILINE))


class DebianUnitTest(unittest.TestCase):
    def test_as_it_is_installed_it_serves_this_machine_only(self):
        config = deployment.effective(CONFIG, {})
        self.assertRegex(config["listen"], r"^127\.0\.0\.1:")
        self.assertRegex(config["metrics-listen"], r"^127\.0\.0\.1:")

    def test_shown_defaults_are_the_defaults(self):
        plain = deployment.effective_text("", {})
        shown = re.findall(r'^#([a-z-]+) = "?([^"\n]*)"?$', CONFIG.read_text(), re.MULTILINE)
        self.assertGreater(len(shown), 8)
        examples = {"tls-cert", "tls-key", "api-keys"}
        first = {}
        for key, value in shown:
            first.setdefault(key, value)
        for key, value in first.items():
            if key not in examples:
                self.assertEqual(plain[key], value, key)

    def test_shown_example_of_an_open_server_is_accepted(self):
        text = CONFIG.read_text()
        example = text[text.index('#listen = "0.0.0.0') : text.index("# Prometheus")]
        config = deployment.effective_text(example.replace("#", ""), {})
        self.assertEqual(config["listen"], "0.0.0.0:7443")

    def test_state_is_where_systemd_makes_it(self):
        config = deployment.ask_server(
            ["--config", str(CONFIG), "--print-config"], {"STATE_DIRECTORY": "/var/lib/isomatch"}
        )
        self.assertIn('data-dir = "/var/lib/isomatch"', config.stdout)
        self.assertEqual(unit()["StateDirectory"], "isomatch")
        postrm = (ROOT / "docker/debian/postrm").read_text()
        self.assertIn("rm -rf /var/lib/isomatch\n", postrm)

    def test_has_time_to_drain(self):
        config = deployment.effective(CONFIG, {})
        jobs = [config["drain-timeout"], config["unresponsive-grace"]]
        stop = deployment.seconds(unit()["TimeoutStopSec"])
        needed = sum(map(deployment.seconds, jobs)) + deployment.LAST_SECONDS
        self.assertGreater(stop, needed)

    def test_wrong_settings_are_not_tried_again(self):
        answer = deployment.ask_server(["--workers", "0"], {})
        self.assertEqual(str(answer.returncode), unit()["RestartPreventExitStatus"])


if __name__ == "__main__":
    deployment.main()
