# One image, two commands; docs/compose.yaml runs the service with PostgreSQL and workers.
#   docker build -t rcsa-ident . && docker run --rm -v "$PWD:/data" rcsa-ident check /data/campaign
#   docker build --target service -t rcsa-ident-service . && docker run --init -p 127.0.0.1:8000:8000 -v rcsa-ident:/data rcsa-ident-service
FROM python:3.13-slim AS build

WORKDIR /opt/source
# the same versions as in CI, by their hashes; they are installed anew only where they change
COPY .ci/image.txt ./.ci/image.txt
RUN python -m venv /opt/rcsa-ident && /opt/rcsa-ident/bin/pip install --no-cache-dir --require-hashes -r .ci/image.txt
COPY pyproject.toml README.md LICENSE ./
COPY rcsa_ident ./rcsa_ident
COPY api ./api
COPY data/machines ./data/machines
COPY data/robots ./data/robots
RUN /opt/rcsa-ident/bin/pip install --no-cache-dir --no-deps --no-build-isolation --no-index .


FROM python:3.13-slim AS installed

# libgomp1: numba's OpenMP layer; without it numba falls back to one that aborts under threads
# its version is the base image's: a pinned one is gone with the next point release
# hadolint ignore=DL3008
RUN apt-get update && apt-get install -y --no-install-recommends libgomp1 && rm -rf /var/lib/apt/lists/* \
    && useradd --create-home --uid 1000 ident \
    && mkdir -p /var/cache/rcsa-ident /data && chown ident:ident /var/cache/rcsa-ident /data

COPY --from=build /opt/rcsa-ident /opt/rcsa-ident
ENV PATH=/opt/rcsa-ident/bin:$PATH PYTHONDONTWRITEBYTECODE=1 PYTHONUNBUFFERED=1 \
    NUMBA_CACHE_DIR=/var/cache/rcsa-ident NUMBA_THREADING_LAYER=omp OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 \
    MPLBACKEND=Agg MPLCONFIGDIR=/var/cache/rcsa-ident/matplotlib

USER 1000
# kernels are compiled once here, not at every start
RUN rcsa-ident warm
# what may be written where the rest of the file system is read-only; numba asks to write beside what it only reads
VOLUME ["/data", "/var/cache/rcsa-ident"]
WORKDIR /data


FROM installed AS service

ENV RCSA_IDENT_DATA=/data RCSA_IDENT_HOST=0.0.0.0
EXPOSE 8000
# a wide start: an older store's tables are carried forward before the service answers
HEALTHCHECK --interval=30s --timeout=5s --start-period=120s --start-interval=2s --retries=3 \
    CMD ["python", "-c", "from urllib.request import urlopen; urlopen('http://127.0.0.1:8000/ready', timeout=4)"]
ENTRYPOINT ["rcsa-ident-serve"]


# the last stage is what a build without --target makes
FROM installed AS command

# as process 1 a command ignores SIGTERM, and ends on Ctrl-C without a word
STOPSIGNAL SIGINT
ENTRYPOINT ["rcsa-ident"]
CMD ["--help"]
