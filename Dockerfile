# The page is built once with Node; the server image holds Python, PoCL (from its wheel) and the built page only.
FROM node:22-bookworm-slim AS page
WORKDIR /esker
COPY frontend/package.json frontend/package-lock.json frontend/.npmrc frontend/
RUN npm --prefix frontend install --no-save
COPY shaders shaders
COPY frontend frontend
RUN npm --prefix frontend run build

FROM python:3.11-slim-bookworm
WORKDIR /esker
COPY requirements.lock build.in pyproject.toml README.md ./
RUN pip install --no-cache-dir --require-hashes -r requirements.lock
COPY backend backend
COPY shaders shaders
RUN pip install --no-cache-dir --no-deps --no-build-isolation -e .
COPY --from=page /esker/frontend/dist frontend/dist
RUN useradd --create-home esker && mkdir /data && chown esker /data
USER esker
VOLUME /data
EXPOSE 8000
HEALTHCHECK --interval=15s --timeout=3s CMD ["python", "-c", "import urllib.request as u; u.urlopen('http://127.0.0.1:8000/healthz', timeout=2)"]
CMD ["python", "-m", "esker", "serve", "--host", "0.0.0.0", "--port", "8000", "--data", "/data"]
