"""The gRPC contract as a page: its services, messages and enumerations with the comments of the proto."""

import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from google.protobuf.descriptor_pb2 import FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet

from docs_site.tables import table

ROOT = Path(__file__).parents[1]
PROTO = "shipshape/v1/shipshape.proto"
MESSAGES, ENUMS, SERVICES, FIELDS, VALUES, METHODS = 4, 5, 6, 2, 2, 2  # numbers of fields in descriptor.proto


def page() -> str:
    """The page, in Markdown."""
    file = _descriptor()
    said = {tuple(place.path): place for place in file.source_code_info.location}
    head = _paragraphs("\n".join(said[(12,)].leading_detached_comments) + said[(12,)].leading_comments)
    return "\n".join(
        ["# gRPC: shipshape.v1", head, *_services(file, said), *_messages(file, said), *_enums(file, said)]
    )


def _descriptor() -> FileDescriptorProto:
    with tempfile.NamedTemporaryFile(suffix=".pb") as out:
        command = [sys.executable, "-m", "grpc_tools.protoc", f"--proto_path={ROOT / 'proto'}"]
        command += ["--include_source_info", f"--descriptor_set_out={out.name}", str(ROOT / "proto" / PROTO)]
        subprocess.run(command, check=True)
        (file,) = FileDescriptorSet.FromString(Path(out.name).read_bytes()).file
    return file


def _services(file: FileDescriptorProto, said: dict[Any, Any]) -> Iterator[str]:
    for s, service in enumerate(file.service):
        yield f"\n## {service.name}\n"
        rows = []
        for m, method in enumerate(service.method):
            asked, answered = (_link(name.rpartition(".")[2]) for name in (method.input_type, method.output_type))
            asked = f"stream of {asked}" if method.client_streaming else asked
            answered = f"stream of {answered}" if method.server_streaming else answered
            rows.append([f"`{method.name}`", asked, answered, _comment(said, SERVICES, s, METHODS, m)])
        yield table(["method", "takes", "gives", ""], rows)


def _messages(file: FileDescriptorProto, said: dict[Any, Any]) -> Iterator[str]:
    for m, message in enumerate(file.message_type):
        yield f"\n## {message.name}\n\n{_comment(said, MESSAGES, m)}\n"
        maps = {nested.name: nested for nested in message.nested_type}
        rows = [
            [f"`{field.name}`", _type(field, maps), str(field.number), _comment(said, MESSAGES, m, FIELDS, f)]
            for f, field in enumerate(message.field)
        ]
        if rows:
            yield table(["field", "type", "number", ""], rows)


def _enums(file: FileDescriptorProto, said: dict[Any, Any]) -> Iterator[str]:
    for e, enum in enumerate(file.enum_type):
        yield f"\n## {enum.name}\n\n{_comment(said, ENUMS, e)}\n"
        values = enumerate(enum.value)
        rows = [[f"`{value.name}`", str(value.number), _comment(said, ENUMS, e, VALUES, v)] for v, value in values]
        yield table(["value", "number", ""], rows)


def _type(field: FieldDescriptorProto, maps: dict[str, Any]) -> str:
    name = field.type_name.rpartition(".")[2]
    if name in maps:
        key, value = (FieldDescriptorProto.Type.Name(each.type)[5:].lower() for each in maps[name].field)
        return f"map of {key} to {value}"
    plain = _link(name) if name else FieldDescriptorProto.Type.Name(field.type).removeprefix("TYPE_").lower()
    if field.label == FieldDescriptorProto.LABEL_REPEATED:
        return f"repeated {plain}"
    return f"optional {plain}" if field.proto3_optional else plain


def _link(name: str) -> str:
    return f"[{name}](#{name.lower()})"


def _comment(said: dict[Any, Any], *path: int) -> str:
    place = said.get(path)
    return (place.leading_comments or place.trailing_comments).strip() if place else ""


def _paragraphs(text: str) -> str:
    return re.sub(r"^ ", "", text, flags=re.M)
