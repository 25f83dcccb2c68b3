# A recorder in a container: slim, not root, the adapter passed in.
#   docker build -t rtuscope .
#   docker run --rm --device /dev/ttyUSB0 --group-add dialout rtuscope sniff /dev/ttyUSB0
FROM python:3.13-slim AS build
WORKDIR /source
COPY . .
RUN python -m venv /opt/rtuscope && /opt/rtuscope/bin/pip install --no-cache-dir '.[metrics,mqtt]'

FROM python:3.13-slim
RUN useradd --create-home --groups dialout rtuscope && install -d -o rtuscope /data
COPY --from=build /opt/rtuscope /opt/rtuscope
ENV PATH=/opt/rtuscope/bin:$PATH PYTHONUNBUFFERED=1
USER rtuscope
WORKDIR /data
VOLUME /data
ENTRYPOINT ["rtuscope"]
CMD ["--help"]
