#!/bin/sh
# One contact over REST with curl: examples/curl.sh, or examples/curl.sh http://HOST:8080
set -eu
# The points of a binary PCD file follow its header: little-endian float32 x y z, metres, level frame.
LC_ALL=C sed '1,/^DATA binary$/d' "$(dirname "$0")/contact.pcd" |
  curl -sS --fail-with-body --noproxy '*' --max-time 15 \
    -H 'Content-Type: application/octet-stream' -H 'Shipshape-Timeout-Ms: 10000' \
    --data-binary @- "${1:-http://127.0.0.1:8080}/v1/recognise?sensor_height_m=3"
