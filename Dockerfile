# The page is built once with Node; the server image holds Python, PoCL (from its wheel) and the built page only.
FROM node:22-bookworm-slim@sha256:43ac6c60b8f89723f746e8a92ce91abd5017e627ce1ddfe4238355d3a30b772c AS page
WORKDIR /esker/frontend
COPY frontend/package.json frontend/package-lock.json frontend/.npmrc ./
# Exactly what is locked, or nothing. Without the linter, which nothing here runs: the lock file lacks its programs for
# other systems, and npm ci takes that for a mistake.
RUN npm pkg delete "devDependencies.@biomejs/biome" && npm ci
COPY NOTICE /esker/
COPY shaders /esker/shaders
COPY frontend ./
# Not `npm run build`: that checks types, those of tests too, whose vectors are not here. `make check` does.
RUN npx --no-install vite build

FROM python:3.11-slim-bookworm@sha256:a36c24f9cbdf4fd0f52d67f0823eeac19c2028c637cecc392d97f980d4fec56b
# What the wheels leave to the system: libexpat for rasterio; OpenGL on the processor for pictures of terrains.
RUN apt-get update \
    && apt-get install -y --no-install-recommends libegl1 libexpat1 libgl1-mesa-dri \
    && rm -rf /var/lib/apt/lists/*
WORKDIR /esker
COPY requirements-cluster.lock build.in pyproject.toml README.md LICENSE NOTICE ./
RUN pip install --no-cache-dir --require-hashes -r requirements-cluster.lock
COPY backend backend
COPY shaders shaders
RUN pip install --no-cache-dir --no-deps --no-build-isolation -e . && python -m compileall -q backend
COPY --from=page /esker/frontend/dist frontend/dist
RUN useradd --create-home esker && mkdir /data && chown esker:esker /data
USER esker
# The root may be read-only: what is compiled for this processor is kept with the data.
ENV XDG_CACHE_HOME=/data/.cache NUMBA_CACHE_DIR=/data/.cache/numba PYTHONDONTWRITEBYTECODE=1
VOLUME /data
EXPOSE 8000
# Kernels are compiled at the first start, by children that may try more than one level.
HEALTHCHECK --interval=15s --timeout=3s --start-period=180s CMD ["python", "-c", "import urllib.request as u; u.urlopen('http://127.0.0.1:8000/readyz', timeout=2)"]
CMD ["python", "-m", "esker", "serve", "--host", "0.0.0.0", "--port", "8000", "--data", "/data"]
