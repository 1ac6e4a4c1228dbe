# Use: docker build -t epsmesh . && docker run --rm -it -v "$PWD/results:/epsmesh/results" epsmesh
# `make docker-steps` runs the RUN lines in a root of Debian 12, without Docker.
FROM debian:12
WORKDIR /epsmesh
COPY . .
RUN apt-get update
RUN apt-get install -y --no-install-recommends ca-certificates make git
RUN make setup
ENV PATH=/epsmesh/.venv/bin:$PATH
ENV OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
CMD ["make", "study"]
