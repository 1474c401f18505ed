#!/bin/sh
# Builds the image and holds it to what Dockerfile and docs/deploy.md promise, with docker or podman.
#
#   deploy/prove_image.sh                                     # docker, else podman
#   ENGINE=podman BUILD_FLAGS="--isolation chroot" RUN_FLAGS="--network host" deploy/prove_image.sh
set -eu
cd "$(dirname "$0")/.."
engine=${ENGINE:-$(command -v docker || command -v podman)} || {
  echo "prove_image: expected docker or podman, found neither: name another engine with ENGINE=..." >&2
  exit 2
}
image=shipshape:proof
name=shipshape-proof-$$
fail() { echo "prove_image: $*" >&2; exit 1; }
inside() { $engine exec --interactive "$name" "$@"; }
trap '$engine rm --force "$name" >/dev/null 2>&1 || true' EXIT

echo "1. build"
# Flags are words: they are meant to be split.
# shellcheck disable=SC2086
$engine build ${BUILD_FLAGS:-} --tag "$image" .

echo "2. start: read-only, no privileges, a memory file system at /tmp"
# shellcheck disable=SC2086
$engine run ${RUN_FLAGS:-} --detach --name "$name" --read-only --tmpfs /tmp --cap-drop ALL \
  --security-opt no-new-privileges "$image" >/dev/null

echo "3. healthy by the image's own check"
healthy() { # podman runs checks by timers of systemd, which may not be there; docker by itself
  case $engine in
    *podman*) $engine healthcheck run "$name" >/dev/null 2>&1 ;;
    *) [ "$($engine inspect --format '{{.State.Health.Status}}' "$name")" = healthy ] ;;
  esac
}
seconds=0
until healthy; do
  [ "$($engine inspect --format '{{.State.Running}}' "$name")" = true ] || { $engine logs "$name" >&2; fail "it ended"; }
  [ $((seconds += 1)) -le 60 ] || { $engine logs "$name" >&2; fail "expected it to be healthy in 60 s, got none"; }
  sleep 1
done

echo "4. what is inside"
[ "$(inside id -u)" = 65532 ] || fail "expected user 65532, got $(inside id -u)"
! inside sh -c 'echo >/opt/shipshape/x' 2>/dev/null || fail "expected a read-only root, could write to it"
for tool in gcc cc ld as make curl pip; do
  ! inside sh -c "command -v $tool" >/dev/null || fail "expected no $tool in the image"
done
for module in torch pip hatchling shipshape_lab matplotlib; do
  ! inside python -c "import $module" 2>/dev/null || fail "expected no Python module $module in the image"
done
inside diff -r /opt/shipshape/kernels /tmp/shipshape-kernels || fail "expected no kernel to be compiled at the start"

echo "5. an answer"
inside python - <<'END' || fail "expected an answer to the built-in contact"
import json, urllib.request
from shipshape.sample import sample_contact

body = sample_contact().points_level.astype("<f4").tobytes()
ask = urllib.request.Request("http://127.0.0.1:8080/v1/recognise", body, {"Content-Type": "application/octet-stream"})
with urllib.request.build_opener(urllib.request.ProxyHandler({})).open(ask, timeout=10) as response:
    answer = json.load(response)
print("  ", answer["vessel"], answer["probability"], response.headers["Server-Timing"])
assert not answer["unknown"]
END

echo "6. the console"
inside python - <<'END' || fail "expected the console at /"
import urllib.request

with urllib.request.build_opener(urllib.request.ProxyHandler({})).open("http://127.0.0.1:8080/") as page:
    assert b"<title>" in page.read()
END

echo "7. SIGTERM: drained, exit code 0"
$engine stop --time 20 "$name" >/dev/null
code=$($engine inspect --format '{{.State.ExitCode}}' "$name")
[ "$code" = 0 ] || fail "expected exit code 0, got $code"
$engine logs "$name" 2>&1 | tail -1 | grep -q '"message": "stopped"' || fail "expected \"stopped\" as its last line"
echo "the image is as promised: $($engine image inspect --format '{{.Size}}' "$image") bytes"
