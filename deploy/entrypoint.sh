#!/bin/sh
# Starts `shipshape` in the image. Numba takes a cache only from a folder that it may write to, and the image is
# read-only: its compiled kernels, a megabyte, go to /tmp first.
set -eu
mkdir -p "$NUMBA_CACHE_DIR" && cp -R /opt/shipshape/kernels/. "$NUMBA_CACHE_DIR" || {
  echo "shipshape: expected to write $NUMBA_CACHE_DIR, got no room there: mount a tmpfs or an emptyDir at /tmp" >&2
  exit 2
}
exec shipshape "$@"
