#!/bin/sh
# Builds the console into service/shipshape/console/static, from which the service and its wheel take it.
# Needs Node.js 18 or newer with npm; what package-lock.json names is installed the first time and when it changed.
set -eu
cd "$(dirname "$0")"
command -v npm >/dev/null || {
  echo "console: expected Node.js with npm, got none: on Debian, apt-get install npm" >&2
  exit 1
}
if [ ! -e node_modules/.package-lock.json ] || [ package-lock.json -nt node_modules/.package-lock.json ]; then
  npm ci --no-audit --no-fund --loglevel error
fi
npm run --silent check
npm run --silent build
