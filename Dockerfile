# scengen with OpenGL without a display. The demo, its pools and contact sheet in ./out:
#   docker build --tag scengen . && docker run --rm --volume "$PWD/out:/scengen/generated/demo" scengen
# Anything else: docker run --rm --volume "$PWD/out:/out" scengen .venv/bin/scengen generate task=packing n=10 pool=/out/packing
FROM python:3.11-slim-bookworm

# EGL draws with Mesa's software renderer where there is no graphics card; OSMesa is MuJoCo's second choice.
RUN apt-get update \
    && apt-get install --yes --no-install-recommends make libegl1 libgl1 libosmesa6 \
    && rm -rf /var/lib/apt/lists/*

WORKDIR /scengen
COPY . .
RUN make setup

CMD ["make", "demo"]
