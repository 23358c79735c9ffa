"""The messages of isomatch.v1, as `messages.CreateJobRequest` and so on.

They are built from service.binpb, the compiled description of service.proto,
in a descriptor pool of their own. So no generated code has to fit the protobuf
that is installed, and whatever else the program imports - its own stubs of the
same service, Google's google.rpc - cannot clash with it.
"""

from __future__ import annotations

from importlib import resources
from typing import Any

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

_PACKAGE = "isomatch.v1"


_files = descriptor_pb2.FileDescriptorSet.FromString(
    resources.files(__package__).joinpath("service.binpb").read_bytes()
).file
_pool = descriptor_pool.DescriptorPool()
for _file in _files:
    _pool.AddSerializedFile(_file.SerializeToString())
# Protobuf 4.22 and later make classes without one.
_factory: Any = None
if not hasattr(message_factory, "GetMessageClass"):
    _factory = message_factory.MessageFactory(_pool)


def _class_of(full_name: str) -> Any:
    descriptor = _pool.FindMessageTypeByName(full_name)
    if _factory is not None:
        return _factory.GetPrototype(descriptor)
    return message_factory.GetMessageClass(descriptor)


def __getattr__(name: str) -> Any:
    try:
        found = _class_of(f"{_PACKAGE}.{name}")
    except KeyError:
        raise AttributeError(f"{_PACKAGE} has no message {name}") from None
    globals()[name] = found
    return found


ErrorStatus = _class_of("google.rpc.Status")
ErrorInfo = _class_of("google.rpc.ErrorInfo")
BadRequest = _class_of("google.rpc.BadRequest")
RetryInfo = _class_of("google.rpc.RetryInfo")


def service_methods() -> list[Any]:
    """The MethodDescriptorProto of each RPC."""
    return [
        method
        for file in _files
        if file.package == _PACKAGE
        for service in file.service
        for method in service.method
    ]


def class_of_type(type_name: str) -> Any:
    """The class of a message that a MethodDescriptorProto names."""
    return _class_of(type_name.removeprefix("."))


def _enum_type(enum: str) -> Any:
    return _pool.FindEnumTypeByName(f"{_PACKAGE}.{enum}")


def enum_name(enum: str, number: int) -> str | None:
    """The value's name; None for one that is newer than this package."""
    value = _enum_type(enum).values_by_number.get(number)
    return None if value is None else str(value.name)


def enum_names(enum: str) -> list[str]:
    return [str(value.name) for value in _enum_type(enum).values]


def enum_number(enum: str, name: str) -> int:
    return int(_enum_type(enum).values_by_name[name].number)
