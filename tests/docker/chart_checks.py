"""What holds for every rendering of docker/helm/isomatch: functions that return problems,
so that a test can also see each of them find one. Documents are what helm wrote."""

import functools
import re

import deployment

PROBES = ("startupProbe", "livenessProbe", "readinessProbe")
RESTRICTED = {
    "allowPrivilegeEscalation": False,
    "readOnlyRootFilesystem": True,
    "capabilities": {"drop": ["ALL"]},
}


def of_kind(documents, *kinds):
    return [document for document in documents if document["kind"] in kinds]


def name_of(document):
    return document["metadata"]["name"]


def component(document):
    return document["metadata"]["labels"]["app.kubernetes.io/component"]


def pod_template(workload):
    return workload["spec"]["template"]


def workloads(documents):
    return of_kind(documents, "Deployment", "Job")


def selects(selector, workload):
    labels = pod_template(workload)["metadata"]["labels"]
    return selector.items() <= labels.items()


def selected(selector, documents):
    return [name_of(workload) for workload in workloads(documents) if selects(selector, workload)]


def ports(pod):
    return {
        port["name"]: port["containerPort"]
        for container in pod["spec"]["containers"]
        for port in container.get("ports", [])
    }


def environment(workload):
    """Returns the first container's ISOMATCH_ settings; those of Secrets as a URL."""
    found = {}
    for entry in pod_template(workload)["spec"]["containers"][0]["env"]:
        found[entry["name"]] = entry.get("value", "postgresql://secret@secret:1/secret")
    return found


def config(documents, deployed):
    """Returns what the server makes of a Deployment's ConfigMap and environment."""
    [volume] = [v for v in pod_template(deployed)["spec"]["volumes"] if v["name"] == "config"]
    [text] = [
        document["data"]["server.toml"]
        for document in of_kind(documents, "ConfigMap")
        if name_of(document) == volume["configMap"]["name"]
    ]
    return effective(text, tuple(environment(deployed).items()))


@functools.cache
def effective(text, settings):
    return deployment.effective_text(text, dict(settings))


def expected_probe(container, probe):
    if container == "edge":
        return {"tcpSocket": {"port": "grpc"}}
    path = "/readyz" if probe == "readinessProbe" else "/healthz"
    return {"httpGet": {"path": path, "port": "metrics"}}


def probe_problems(documents):
    for deployed in of_kind(documents, "Deployment"):
        template = pod_template(deployed)
        for container in template["spec"]["containers"]:
            where = f"{name_of(deployed)}, {container['name']}"
            for probe in PROBES:
                expected = expected_probe(container["name"], probe)
                if not expected.items() <= container.get(probe, {}).items():
                    yield f"{where}: {probe} is not {expected}"
        if "metrics" not in ports(template):
            yield f"{name_of(deployed)}: no port has the name metrics"


def pause_seconds(container):
    return container.get("lifecycle", {}).get("preStop", {}).get("sleep", {}).get("seconds", 0)


def grace_problems(documents):
    for deployed in of_kind(documents, "Deployment"):
        settings = config(documents, deployed)
        pod = pod_template(deployed)["spec"]
        needed = sum(deployment.seconds(settings[key]) for key in ("drain-timeout", "unresponsive-grace"))
        needed += deployment.LAST_SECONDS + max(map(pause_seconds, pod["containers"]))
        if pod["terminationGracePeriodSeconds"] <= needed:
            yield f"{name_of(deployed)}: has no {needed} s to end"


def budget_problems(documents):
    budgets = of_kind(documents, "PodDisruptionBudget")
    found = [selected(budget["spec"]["selector"]["matchLabels"], documents) for budget in budgets]
    expected = [[name_of(deployed)] for deployed in of_kind(documents, "Deployment")]
    if sorted(found) != sorted(expected):
        yield f"budgets are for {found}, expected one for each of {expected}"
    for budget in budgets:
        if budget["spec"].get("maxUnavailable") in (None, 0, "0%"):
            yield f"{name_of(budget)}: no node could ever be drained"


def service_problems(documents):
    for service in of_kind(documents, "Service"):
        names = selected(service["spec"]["selector"], documents)
        if len(names) != 1:
            yield f"Service {name_of(service)} is for {names}"
            continue
        [target] = [w for w in workloads(documents) if name_of(w) == names[0]]
        for port in service["spec"]["ports"]:
            if port["targetPort"] not in ports(pod_template(target)):
                yield f"Service {name_of(service)}: no port {port['targetPort']}"


def selector_problems(documents):
    yield from service_problems(documents)
    for deployed in of_kind(documents, "Deployment"):
        selector = deployed["spec"]["selector"]["matchLabels"]
        if selected(selector, documents) != [name_of(deployed)]:
            yield f"{name_of(deployed)}: its selector is for {selected(selector, documents)}"
        for spread in pod_template(deployed)["spec"]["topologySpreadConstraints"]:
            if spread["labelSelector"]["matchLabels"] != selector:
                yield f"{name_of(deployed)}: spreads over {spread['topologyKey']} as others do"
    for monitor in of_kind(documents, "PodMonitor"):
        names = selected(monitor["spec"]["selector"]["matchLabels"], documents)
        if not {name_of(deployed) for deployed in of_kind(documents, "Deployment")} <= set(names):
            yield f"PodMonitor is for {names}"


def scaling_problems(documents):
    """What is scaled says no number of its own, or each upgrade would set it back."""
    scaled = []
    for scaler in of_kind(documents, "HorizontalPodAutoscaler", "ScaledObject"):
        scaled.append(scaler["spec"]["scaleTargetRef"]["name"])
    for deployed in of_kind(documents, "Deployment"):
        if ("replicas" in deployed["spec"]) == (name_of(deployed) in scaled):
            yield f"{name_of(deployed)}: replicas are said by it, or by a scaler, not by both"
    names = {name_of(deployed) for deployed in of_kind(documents, "Deployment")}
    yield from (f"{name} is scaled, but not there" for name in set(scaled) - names)
    for scaler in of_kind(documents, "ScaledObject"):
        yield from keda_problems(documents, scaler)


def keda_problems(documents, scaler):
    [target] = [d for d in of_kind(documents, "Deployment")
                if name_of(d) == scaler["spec"]["scaleTargetRef"]["name"]]  # fmt: skip
    [trigger] = scaler["spec"]["triggers"]
    query = trigger["metadata"]["query"]
    if not re.fullmatch(r"SELECT count\(\*\) FROM isomatch\.live_jobs", query):
        yield f"scales by {query}, expected all jobs that are not over"
    if trigger["metadata"]["targetQueryValue"] != config(documents, target)["workers"]:
        yield "scales to another number of jobs than a worker runs"
    known = {name_of(document) for document in of_kind(documents, "TriggerAuthentication")}
    if trigger.get("authenticationRef", {"name": None})["name"] not in known | {None}:
        yield "scales with an authentication that is not there"


def secrets_of(values):
    """Returns the names that values give for Secrets."""
    database = values["database"]
    parts = [values.get(key, {}) for key in ("tls", "apiKeys")]
    parts += [database.get(key, {}) for key in ("ca", "password", "urlSecret")]
    names = {part.get("secretName") or part.get("name") for part in parts}
    return names | set(values.get("image", {}).get("pullSecrets", []))


def references(thing):
    """Yields (Secret or ConfigMap, name) of all that a document refers to."""
    if isinstance(thing, list):
        for part in thing:
            yield from references(part)
    if not isinstance(thing, dict):
        return
    for key, value in thing.items():
        if key == "secretName":
            yield "Secret", value
        elif key in ("secretKeyRef", "configMap", "configMapKeyRef"):
            yield ("Secret" if key == "secretKeyRef" else "ConfigMap"), value["name"]
        elif key in ("imagePullSecrets", "secretTargetRef"):
            yield from (("Secret", entry["name"]) for entry in value)
        yield from references(value)


def reference_problems(documents, values):
    maps = {name_of(document) for document in of_kind(documents, "ConfigMap")}
    known = {"ConfigMap": maps, "Secret": secrets_of(values)}
    for document in documents:
        for kind, name in references(document.get("spec", {})):
            if name not in known[kind]:
                yield f"{document['kind']} {name_of(document)}: there is no {kind} {name}"
    if of_kind(documents, "Secret"):
        yield "the chart has a Secret: they are the user's"


def mount_problems(documents):
    for workload in workloads(documents):
        pod = pod_template(workload)["spec"]
        volumes = [volume["name"] for volume in pod.get("volumes", [])]
        mounts = {m["name"] for c in pod["containers"] for m in c.get("volumeMounts", [])}
        if set(volumes) != mounts or len(volumes) != len(set(volumes)):
            yield f"{name_of(workload)}: volumes {volumes}, mounts {sorted(mounts)}"


def blob_problems(documents, values):
    """Gateways and workers share the folder that values name; the migration needs none."""
    blobs = values.get("blobs", {})
    for workload in workloads(documents):
        if workload["kind"] == "Job":
            settings = deployment.effective(deployment.IMAGE_CONFIG, environment(workload))
            claim, read_only = "", False
        else:
            settings = config(documents, workload)
            claim, read_only = blobs.get("claimName", ""), blobs.get("readOnly", False)
        pod = pod_template(workload)["spec"]
        claims = {
            volume["name"]: volume["persistentVolumeClaim"]["claimName"]
            for volume in pod.get("volumes", [])
            if "persistentVolumeClaim" in volume
        }
        # Written also with readOnly, which is about new files.
        found = [
            (mount["mountPath"], claims[mount["name"]])
            for mount in pod["containers"][0].get("volumeMounts", [])
            if mount["name"] in claims and not mount.get("readOnly")
        ]
        folder = settings["blob-dir"]
        if found != ([(folder, claim)] if claim else []) or bool(folder) != bool(claim):
            yield f"{name_of(workload)}: blobs are in {folder!r} of {found}, expected {claim!r}"
        if settings["blob-dir-read-only"] != str(read_only).lower():
            yield f"{name_of(workload)}: writes files, or does not, against blobs.readOnly"


def image_problems(documents, values):
    image = values.get("image", {})
    tag = image.get("tag") or deployment.project_version()
    known = {f"{image.get('registry', '')}isomatch-{name}:{tag}" for name in ("server", "edge")}
    for workload in workloads(documents):
        for container in pod_template(workload)["spec"]["containers"]:
            if container["image"] not in known or ":latest" in container["image"]:
                yield f"{name_of(workload)}: image {container['image']}, expected one of {known}"


def policy_problems(documents, values):
    if not values.get("networkPolicy", {}).get("enabled", True):
        return
    policies = of_kind(documents, "NetworkPolicy")
    for workload in workloads(documents):
        mine = [p for p in policies if selects(p["spec"]["podSelector"]["matchLabels"], workload)]
        if len(mine) != 1:
            yield f"{name_of(workload)}: has {len(mine)} policies, expected one"
            continue
        yield from rule_problems(workload, mine[0]["spec"], values)


def rule_problems(workload, policy, values):
    name = name_of(workload)
    if sorted(policy["policyTypes"]) != ["Egress", "Ingress"]:
        yield f"{name}: its policy is for {policy['policyTypes']} only"
    allowed = {"gateway": {"grpc", "metrics"}, "worker": {"metrics"}, "migration": set()}
    incoming = {port["port"] for rule in policy["ingress"] for port in rule.get("ports", [{"port": "any"}])}
    if incoming != allowed[component(workload)]:
        yield f"{name}: is called on {incoming}"
    if not incoming <= set(ports(pod_template(workload))):
        yield f"{name}: has no ports {incoming}"
    if any(not rule.get("from") for rule in policy["ingress"]):
        yield f"{name}: is called by anybody"
    database = values.get("database", {}).get("port", 5432)
    database = values.get("networkPolicy", {}).get("databasePort", database)
    outgoing = {port["port"] for rule in policy["egress"] for port in rule.get("ports", [{"port": "any"}])}
    if outgoing != {database, 53}:
        yield f"{name}: calls {outgoing}, expected the database and DNS"


def security_problems(documents):
    for workload in workloads(documents):
        pod = pod_template(workload)["spec"]
        context = pod["securityContext"]
        if not context.get("runAsNonRoot") or context.get("runAsUser") != 10001:
            yield f"{name_of(workload)}: is not user 10001"
        if context.get("seccompProfile") != {"type": "RuntimeDefault"}:
            yield f"{name_of(workload)}: any system call"
        if pod.get("automountServiceAccountToken") is not False:
            yield f"{name_of(workload)}: has a token"
        for container in pod["containers"]:
            if container.get("securityContext") != RESTRICTED:
                yield f"{name_of(workload)}, {container['name']}: is not restricted"
            if "memory" not in container["resources"]["limits"]:
                yield f"{name_of(workload)}, {container['name']}: takes all memory"
            if not {"cpu", "memory"} <= container["resources"]["requests"].keys():
                yield f"{name_of(workload)}, {container['name']}: requests nothing"


def hook_problems(documents, values):
    """The migration is before everything else, so it may refer to nothing of the release."""
    jobs = of_kind(documents, "Job")
    if len(jobs) != values.get("migration", {}).get("enabled", True):
        yield f"{len(jobs)} migrations"
    hooks = [*jobs, *(p for p in of_kind(documents, "NetworkPolicy") if component(p) == "migration")]
    for hook in hooks:
        if hook["metadata"]["annotations"].get("helm.sh/hook") != "pre-install,pre-upgrade":
            yield f"{hook['kind']} {name_of(hook)} is no hook"
    for job in jobs:
        maps = [name for kind, name in references(job["spec"]) if kind == "ConfigMap"]
        if maps or "serviceAccountName" in pod_template(job)["spec"]:
            yield f"{name_of(job)}: refers to what is not there before the release"


def server_problems(documents):
    """The real server takes the settings, and roles are those of the names."""
    for deployed in of_kind(documents, "Deployment"):
        settings = config(documents, deployed)
        if settings["role"] != component(deployed) or not settings["store"].startswith("postgresql://"):
            yield f"{name_of(deployed)}: is {settings['role']} of {settings['store']}"
        if deployment.port(settings["metrics-listen"]) != ports(pod_template(deployed))["metrics"]:
            yield f"{name_of(deployed)}: metrics are at {settings['metrics-listen']}"
        if settings["insecure"] != "false":
            yield f"{name_of(deployed)}: is insecure"
    for job in of_kind(documents, "Job"):
        [container] = pod_template(job)["spec"]["containers"]
        deployment.effective(deployment.IMAGE_CONFIG, environment(job))
        if container["args"] != ["migrate"]:
            yield f"{name_of(job)}: does {container['args']}"


def file_problems(documents):
    """Files that settings name are in a mounted folder."""
    for deployed in of_kind(documents, "Deployment"):
        settings = config(documents, deployed)
        container = pod_template(deployed)["spec"]["containers"][0]
        folders = {mount["mountPath"] for mount in container["volumeMounts"]}
        files = [settings["api-keys"], settings["store-password-file"]]
        files += [settings["listen"].removeprefix("unix:")]
        files += re.findall(r"sslrootcert=([^&]*)", settings["store"])
        for file in filter(None, files):
            if file.rpartition("/")[0] not in folders:
                yield f"{name_of(deployed)}: nothing is mounted for {file}"


# Of documents alone, and of documents with the values.
CHECKS = [
    probe_problems, grace_problems, budget_problems, selector_problems, scaling_problems,
    mount_problems, security_problems, server_problems, file_problems,
]  # fmt: skip
CHECKS_WITH_VALUES = [
    reference_problems, blob_problems, image_problems, policy_problems, hook_problems,
]  # fmt: skip


def problems(documents, values):
    for check in CHECKS:
        yield from check(documents)
    for check in CHECKS_WITH_VALUES:
        yield from check(documents, values)
