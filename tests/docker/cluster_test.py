"""compose.yaml's profile `cluster`, judged by the real server."""

import re
import unittest

import compose
import deployment
from deployment import IMAGE_CONFIG, ROOT

# What an installation of PostgreSQL keeps for its administrators.
RESERVED_CONNECTIONS = 3
COMMAND = "docker compose -f docker/compose.yaml --profile cluster up -d"


def settings(service, variables=None):
    """Returns its ISOMATCH_ variables, as Compose passes them on: as text."""
    return {
        name: compose.interpolated(str(value), variables or {})
        for name, value in service["environment"].items()
        if name.startswith("ISOMATCH_")
    }


class ClusterTest(unittest.TestCase):
    def setUp(self):
        [self.file] = deployment.documents(ROOT / "docker/compose.yaml")
        [self.tls] = deployment.documents(ROOT / "docker/compose.tls.yaml")
        self.services = self.file["services"]
        self.gateway, self.worker = (self.services[name] for name in ("gateway", "worker"))
        self.migrate, self.database = (self.services[name] for name in ("migrate", "database"))
        self.edge = self.services["cluster-edge"]

    def config(self, service):
        return deployment.effective(IMAGE_CONFIG, settings(service))

    def test_without_the_profile_nothing_of_it_runs(self):
        names = set(compose.running(self.services))
        self.assertEqual(names, {"server", "edge", "prometheus", "grafana"})

    def test_the_command_starts_all_but_the_single_server(self):
        text = (ROOT / "docker/compose.yaml").read_text().replace("\\\n#", "")
        command = re.search(rf"{COMMAND}(.*)\n", text).group(1)
        none = re.findall(r"--scale (\w+)=0", command)
        self.assertEqual(none, ["server", "edge"])
        names = set(compose.running(self.services, none, "cluster"))
        self.assertEqual(names, {"database", "migrate", "gateway", "worker", "cluster-edge",
                                 "prometheus", "grafana"})  # fmt: skip

    def test_roles_share_a_database_that_exists(self):
        made = self.database["environment"]
        for service in (self.gateway, self.worker, self.migrate):
            config = self.config(service)
            self.assertEqual(
                config["store"],
                f"postgresql://{made['POSTGRES_USER']}@database:5432/{made['POSTGRES_DB']}",
            )
            self.assertEqual(service["environment"]["PGPASSWORD"], made["POSTGRES_PASSWORD"])
        self.assertEqual(self.config(self.gateway)["role"], "gateway")
        self.assertEqual(self.config(self.worker)["role"], "worker")
        self.assertEqual(self.migrate["command"], ["migrate"])

    def test_tables_are_there_first(self):
        def waits_for(service):
            return {name: how["condition"] for name, how in service["depends_on"].items()}

        self.assertEqual(waits_for(self.migrate), {"database": "service_healthy"})
        for service in (self.gateway, self.worker):
            self.assertEqual(waits_for(service), {"migrate": "service_completed_successfully"})
        self.assertEqual(waits_for(self.edge), {"gateway": "service_started"})
        probe = self.database["healthcheck"]["test"]
        self.assertEqual(probe[:4], ["CMD", "pg_isready", "-h", "127.0.0.1"])

    def test_the_database_is_what_the_queue_needs(self):
        self.assertEqual(self.database["image"], "postgres:15")
        given = dict(setting.split("=") for setting in self.database["command"][2::2])
        self.assertEqual(given["autovacuum_naptime"], "5s")
        each = {"gateway": 20, "worker": 20 + int(self.config(self.worker)["workers"])}
        needed = sum(count * self.services[name]["deploy"]["replicas"] for name, count in each.items())
        self.assertLessEqual(needed + RESERVED_CONNECTIONS, int(given["max_connections"]))
        volumes = [volume.split(":")[0] for volume in self.database["volumes"]]
        self.assertLessEqual(set(volumes), set(self.file["volumes"]))

    def test_meshes_and_results_may_be_in_a_volume_that_both_roles_share(self):
        image = (ROOT / "docker/Dockerfile").read_text()
        for service in (self.gateway, self.worker):
            self.assertEqual(self.config(service)["blob-dir"], "")
            asked = settings(service, {"ISOMATCH_BLOB_DIR": "/data"})
            folder = deployment.effective(IMAGE_CONFIG, asked)["blob-dir"]
            self.assertEqual(service["volumes"], [f"blobs:{folder}"])
            # A new volume has the owner of the image's folder.
            self.assertIn(f"--chown=10001:10001 /image{folder} {folder}\n", image)
        self.assertIn("blobs", self.file["volumes"])

    def test_there_are_two_of_each_role(self):
        for service in (self.gateway, self.worker):
            self.assertEqual(service["deploy"]["replicas"], 2)
            self.assertNotIn("ports", service)  # two could not have the same

    def test_only_the_edge_is_reached(self):
        running = compose.running(self.services, ("server", "edge"), "cluster")
        found = {name: compose.published(service, {}) for name, service in running.items()}
        monitoring = ("prometheus", "grafana")
        ports = {name: where for name, where in found.items() if where and name not in monitoring}
        port = compose.edge_port("listen.conf")
        self.assertEqual(ports, {"cluster-edge": [("127.0.0.1", 7443, port)]})

    def test_the_edge_calls_the_gateways(self):
        [mount] = self.edge["volumes"]
        self.assertEqual(mount, "./edge/servers.cluster.conf:/etc/isomatch-edge/servers.conf:ro")
        host, port = re.search(
            r"^server (\w+):(\d+) ", compose.edge_text("servers.cluster.conf"), re.MULTILINE
        ).groups()
        self.assertIn(host, self.services)
        self.assertIs(self.services[host], self.gateway)
        self.assertEqual(self.config(self.gateway)["listen"], f"0.0.0.0:{port}")
        self.assertEqual(self.config(self.gateway)["behind-edge"], "true")

    def test_prometheus_asks_all_replicas(self):
        [scrape] = deployment.documents(ROOT / "docker/prometheus.yml")
        [job] = scrape["scrape_configs"]
        [names] = job["dns_sd_configs"]
        self.assertEqual(names["names"], ["gateway", "worker"])
        for name in names["names"]:
            config = self.config(self.services[name])
            self.assertEqual(config["metrics-listen"], f"0.0.0.0:{names['port']}")
            self.assertEqual(config["role"], name)

    def test_has_time_to_drain(self):
        for service in (self.gateway, self.worker):
            config = self.config(service)
            needed = sum(deployment.seconds(config[key]) for key in ("drain-timeout", "unresponsive-grace"))
            grace = deployment.seconds(service["stop_grace_period"])
            self.assertGreater(grace, needed + deployment.LAST_SECONDS)

    def test_memory_has_a_limit_and_the_budget_follows_it(self):
        for service in (self.gateway, self.worker, self.edge):
            self.assertGreater(deployment.size(service["mem_limit"]), 0)
        self.assertNotIn("ISOMATCH_MEMORY_BUDGET", self.worker["environment"])

    def test_what_is_ours_is_confined_and_of_this_version(self):
        for name in ("migrate", "gateway", "worker", "cluster-edge"):
            service = self.services[name]
            image = "isomatch-edge" if name == "cluster-edge" else "isomatch-server"
            self.assertEqual(service["image"], f"{image}:{deployment.project_version()}")
            self.assertIs(service["read_only"], True)
            self.assertEqual(service["cap_drop"], ["ALL"])
            self.assertEqual(service["security_opt"], ["no-new-privileges:true"])

    def test_no_image_is_whatever_is_latest(self):
        for name, service in self.services.items():
            self.assertRegex(service["image"], r":v?\d", name)

    def test_the_health_check_of_the_image_is_off_where_nobody_listens(self):
        for name in ("migrate", "worker"):
            self.assertEqual(self.services[name]["healthcheck"], {"disable": True})
        self.assertNotIn("healthcheck", self.gateway)

    def test_with_tls_it_is_as_closed_as_the_single_server(self):
        both = compose.merged(self.file, self.tls)["services"]
        keys = deployment.effective(IMAGE_CONFIG, settings(both["gateway"]))["api-keys"]
        single = deployment.effective(IMAGE_CONFIG, settings(both["server"]))["api-keys"]
        self.assertEqual(keys, single)
        for cluster, alone in (("gateway", "server"), ("cluster-edge", "edge")):
            added = self.tls["services"]
            self.assertEqual(added[cluster], added[alone])


if __name__ == "__main__":
    deployment.main()
