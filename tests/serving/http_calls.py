"""HTTP/1.1 in raw bytes against the REST door of a service."""

import socket
from contextlib import contextmanager

from serving.fakes import PATIENCE

LIVE = b"GET /livez HTTP/1.1\r\nHost: x\r\n\r\n"


@contextmanager
def connected(doors):
    """A socket to the REST door, and a file to read its answers from."""
    address = "127.0.0.1", doors.addresses.rest_port
    with socket.create_connection(address, timeout=PATIENCE) as client, client.makefile("rb") as answers:
        yield client, answers


def read(answers):
    """Status, headers and body of the next answer; None when the connection was closed."""
    line = answers.readline()
    if not line:
        return None
    headers = {}
    while (header := answers.readline()) not in (b"\r\n", b""):
        name, _, value = header.decode().partition(": ")
        headers[name.lower()] = value.strip()
    return int(line.split()[1]), headers, answers.read(int(headers["content-length"]))


def statuses(doors, content):
    """The statuses of all answers to `content`, until the connection is closed; it must be."""
    with connected(doors) as (client, answers):
        client.sendall(content)
        found = []
        while (answer := read(answers)) is not None:
            found.append(answer[0])
        return found


def post(*headers, body=b"", path="/v1/recognise"):
    lines = ("Host: x", "Content-Type: application/octet-stream", *headers)
    return (
        f"POST {path} HTTP/1.1\r\n".encode() + "".join(f"{line}\r\n" for line in lines).encode() + b"\r\n" + body
    )


def in_flight(doors):
    text = doors.rest.get("/metrics").text
    return float(text.partition('shipshape_in_flight{door="rest"} ')[2].split()[0])
