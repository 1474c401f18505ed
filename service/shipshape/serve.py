"""The command that serves; apart from the others, whose libraries the service computes with in other processes."""

import argparse

from shipshape.serving.life import serve as serve_until_signal
from shipshape.settings import load_settings
from shipshape.tracing import traces


def serve(arguments: argparse.Namespace) -> int:
    """Open the doors until a signal."""
    names = ("host", "rest_port", "grpc_port", "workers", "bundle")
    given = {name: value for name in names if (value := getattr(arguments, name)) is not None}
    settings = load_settings(**given)
    with traces(settings.traces_url, settings.traces_share):
        return serve_until_signal(settings)
