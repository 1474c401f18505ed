# The service alone, without a compiler: build packages and compiled kernels in one stage, carry them to another.
#
#   docker build --tag shipshape .
#   docker run --rm --read-only --tmpfs /tmp --stop-timeout 15 -p 127.0.0.1:8080:8080 -p 127.0.0.1:50051:50051 shipshape
#
# All packages are pinned by hash. Pin the bases too, by the digests that your registry shows for the tags:
#   docker build --build-arg BASE=python:3.11-slim-bookworm@sha256:... --build-arg NODE=... --tag shipshape .
ARG BASE=python:3.11-slim-bookworm
ARG NODE=node:22-bookworm-slim

FROM ${NODE} AS console
COPY console /src/console
RUN mkdir -p /src/service/shipshape/console && sh /src/console/build.sh

FROM ${BASE} AS build
WORKDIR /src
ENV PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_NO_CACHE_DIR=1
RUN python -m venv /opt/shipshape
COPY requirements/service.lock requirements/
RUN /opt/shipshape/bin/pip install --require-hashes --requirement requirements/service.lock
COPY pyproject.toml README.md ./
COPY service service
COPY --from=console /src/service/shipshape/console/static service/shipshape/console/static
# What only building needs does not travel on.
RUN /opt/shipshape/bin/pip install --no-build-isolation --no-deps --no-index . \
 && /opt/shipshape/bin/pip uninstall --yes editables hatchling pathspec pluggy trove-classifiers setuptools pip
COPY models /opt/shipshape/bundles/default
# Kernels are compiled here, for any processor of this architecture and with no feature that only this machine has;
# the check runs each of them, and the networks.
ARG NUMBA_CPU_NAME=generic
ENV NUMBA_CPU_NAME=${NUMBA_CPU_NAME} NUMBA_CPU_FEATURES="" NUMBA_CACHE_DIR=/opt/shipshape/kernels
RUN /opt/shipshape/bin/shipshape check --bundle /opt/shipshape/bundles/default

FROM ${BASE}
RUN python -m pip uninstall --yes --root-user-action=ignore setuptools wheel pip \
 && rm -rf /usr/local/lib/python3.11/ensurepip
COPY --from=build /opt/shipshape /opt/shipshape
COPY --chmod=755 deploy/entrypoint.sh /opt/shipshape/
# The same processor as above, or the kernels would be compiled again. /tmp is all that has to be writable.
ARG NUMBA_CPU_NAME=generic
ENV PATH=/opt/shipshape/bin:$PATH \
    PYTHONDONTWRITEBYTECODE=1 \
    NUMBA_CPU_NAME=${NUMBA_CPU_NAME} \
    NUMBA_CPU_FEATURES="" \
    NUMBA_CACHE_DIR=/tmp/shipshape-kernels \
    SHIPSHAPE_BUNDLE=/opt/shipshape/bundles/default \
    SHIPSHAPE_HOST=0.0.0.0 \
    SHIPSHAPE_HEALTH_HOST=0.0.0.0 \
    SHIPSHAPE_HEALTH_PORT=9091
WORKDIR /tmp
USER 65532:65532
EXPOSE 8080 50051 9091
# On loopback, so by no proxy; the slim image has no curl.
HEALTHCHECK --interval=5s --timeout=3s --start-period=60s --retries=3 \
  CMD ["python", "-c", "from urllib.request import *; build_opener(ProxyHandler({})).open('http://127.0.0.1:9091/readyz', timeout=2)"]
ENTRYPOINT ["/opt/shipshape/entrypoint.sh"]
CMD ["serve"]
