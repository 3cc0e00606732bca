# The programs edgepuck and infer-cpu, and the Python package. From the repository's root:
#
#   docker build --tag edgepuck .
#   docker run --rm --user "$(id -u):$(id -g)" --volume "$PWD:/work" edgepuck scan my_mesh.obj --out scan.npz
#   docker run --rm --user "$(id -u):$(id -g)" --volume "$PWD:/work" --entrypoint python edgepuck train.py
#   docker run --rm --network host --entrypoint infer-cpu edgepuck live --udp 2368
#
# podman and buildah take the same words. The image has no Vulkan, so that the CPU casts. For a robot, infer-cpu/Containerfile
# makes one of 10 MB with infer-cpu alone.
FROM rust:1.94-bookworm AS programs
WORKDIR /source
COPY . .
RUN cargo install --locked --path edgepuck --root /out && cargo install --locked --path infer-cpu --root /out

FROM python:3.13-bookworm AS wheel
COPY --from=programs /usr/local/cargo /usr/local/cargo
COPY --from=programs /usr/local/rustup /usr/local/rustup
ENV CARGO_HOME=/usr/local/cargo RUSTUP_HOME=/usr/local/rustup PATH=/usr/local/cargo/bin:$PATH
WORKDIR /source
COPY . .
RUN pip wheel --no-cache-dir --no-deps --wheel-dir /out ./python

FROM python:3.13-slim-bookworm
COPY --from=wheel /out /wheels
RUN pip install --no-cache-dir /wheels/*.whl
# After the package, whose command of the same name starts Python first.
COPY --from=programs /out/bin /usr/local/bin/
WORKDIR /work
ENTRYPOINT ["edgepuck"]
CMD ["--help"]
