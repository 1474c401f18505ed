#!/bin/sh
# Writes service/shipshape/{v1,inference}/ from proto/shipshape/{v1,inference}/. Run from anywhere; needs grpcio-tools of requirements/.
# The proto path equals the package path, so the stubs import each other without patching.
set -eu
cd "$(dirname "$0")/.."
PYTHON="${PYTHON:-.venv/bin/python}"
OUT="${1:-service}"
"$PYTHON" -m grpc_tools.protoc --proto_path=proto \
  --python_out="$OUT" --pyi_out="$OUT" --grpc_python_out="$OUT" \
  proto/shipshape/v1/shipshape.proto proto/shipshape/inference/open_inference.proto
