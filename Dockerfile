# The command line in a container: docker build -t rcsa-ident . && docker run --rm -v "$PWD:/data" rcsa-ident check /data/campaign
FROM python:3.13-slim

# libgomp1: numba's OpenMP layer; without it numba falls back to one that aborts under threads
RUN apt-get update && apt-get install -y --no-install-recommends libgomp1 && rm -rf /var/lib/apt/lists/* \
    && useradd --create-home --uid 1000 ident

ENV NUMBA_CACHE_DIR=/var/cache/rcsa-ident NUMBA_THREADING_LAYER=omp MPLBACKEND=Agg \
    OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 PYTHONDONTWRITEBYTECODE=1
RUN mkdir -p /var/cache/rcsa-ident /data && chown ident:ident /var/cache/rcsa-ident /data

WORKDIR /opt/rcsa-ident
COPY pyproject.toml README.md LICENSE ./
COPY rcsa_ident ./rcsa_ident
COPY api ./api
COPY data/machines ./data/machines
RUN pip install --no-cache-dir .

USER ident
# kernels are compiled once here, not at every start
RUN rcsa-ident warm

WORKDIR /data
ENTRYPOINT ["rcsa-ident"]
CMD ["--help"]
