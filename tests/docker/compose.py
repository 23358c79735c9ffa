"""What tests of compose files share: Compose's own rules, and what the edge says."""

import re

from deployment import ROOT


def edge_text(name):
    return (ROOT / "docker/edge" / name).read_text()


def edge_port(name):
    return int(re.search(r"^listen (\d+) ", edge_text(name), re.MULTILINE).group(1))


def edge_socket():
    return re.search(r"server unix:(\S+) ", edge_text("servers.conf")).group(1)


def interpolated(text, variables):
    """Replaces ${NAME:-DEFAULT}, as Compose does."""
    return re.sub(
        r"\$\{(\w+):-([^}]*)\}", lambda found: variables.get(found[1]) or found[2], text
    )


def merged(below, above, key=""):
    """What Compose makes of two files: of lists both parts, volumes by where they are mounted."""
    if isinstance(below, dict) and isinstance(above, dict):
        both = {**below, **above}
        return {name: merged(below.get(name, value), above.get(name, value), name)
                for name, value in both.items()}  # fmt: skip
    if isinstance(below, list) and below is not above:
        if key == "volumes":
            mounts = {volume.split(":")[1]: volume for volume in [*below, *above]}
            return list(mounts.values())
        return list(dict.fromkeys([*below, *above]))
    return above


def published(service, variables):
    """Returns address, port and the container's port of each mapping."""
    found = []
    for mapping in service.get("ports", []):
        *address, outside, inside = interpolated(mapping, variables).split(":")
        found.append((":".join(address), int(outside), int(inside)))
    return found


def running(services, scaled_to_none=(), profile=""):
    """Returns the services that run without a profile, or with this one."""
    return {
        name: service
        for name, service in services.items()
        if profile in service.get("profiles", [profile]) and name not in scaled_to_none
    }
