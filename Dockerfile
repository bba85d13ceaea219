# scengen with OpenGL without a display, as a user without rights. Its working folder is /out:
#   docker build --tag scengen . && mkdir -p out
#   docker run --rm --user "$(id -u):$(id -g)" --volume "$PWD/out:/out" scengen generate task=packing n=10 pool=packing
# The demo: docker run --rm --user "$(id -u):$(id -g)" --volume "$PWD/out:/out" --entrypoint make scengen -C /scengen demo DEMO=/out
# The digest is that of the index for all platforms; docker buildx imagetools inspect python:3.11-slim-bookworm prints the newest one.
FROM python:3.11.16-slim-bookworm@sha256:a36c24f9cbdf4fd0f52d67f0823eeac19c2028c637cecc392d97f980d4fec56b

# EGL draws with Mesa's software renderer where there is no graphics card; OSMesa is MuJoCo's second choice.
RUN apt-get update \
    && apt-get install --yes --no-install-recommends make libegl1 libgl1 libosmesa6 \
    && rm -rf /var/lib/apt/lists/*

# Any user may run the image: numba writes beside the compiled control loop, other packages into the home folder.
ENV NUMBA_CACHE_DIR=/var/cache/numba HOME=/tmp PATH=/scengen/.venv/bin:$PATH
COPY . /scengen
RUN make -C /scengen setup && chmod -R a+rwX /var/cache/numba

RUN useradd --uid 1000 --no-create-home scengen && install --directory --owner scengen /out
USER scengen
WORKDIR /out
ENTRYPOINT ["scengen"]
CMD ["--help"]
