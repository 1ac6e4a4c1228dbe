# docker build -t epsmesh . && docker run --rm -it -v "$PWD/results:/home/epsmesh/results" epsmesh
# docker build -t epsmesh:lab --target lab . && docker run --rm -it -p 8888:8888 epsmesh:lab
# Other extras of pyproject.toml: --build-arg EXTRAS=solver,organs,repair. Studies are run by a user, not by root.
# No hosted builder has run this file yet. `make docker-steps` runs its lines, of both images, in a chroot of Debian 13.
FROM debian:13 AS libraries
# A compiler for kernels, which are compiled at first use; the rest is what the wheel of gmsh links to.
RUN apt-get update && apt-get install -y --no-install-recommends ca-certificates gcc libc6-dev libgl1 libglu1-mesa libgomp1 libxcursor1 libxft2 libxinerama1 python3-dev python3-venv && rm -rf /var/lib/apt/lists/*
RUN useradd --create-home --uid 1000 epsmesh
USER epsmesh
WORKDIR /home/epsmesh
ENV PATH=/home/epsmesh/venv/bin:$PATH
RUN python3 -m venv venv && mkdir results
# Libraries before sources: Docker installs them again only if pyproject.toml changes.
ARG EXTRAS=solver
COPY --chown=epsmesh pyproject.toml source/pyproject.toml
RUN python -c "import os, tomllib; p = tomllib.load(open('source/pyproject.toml', 'rb'))['project']; extras = os.environ['EXTRAS'].split(','); print(*p['dependencies'], *(one for extra in extras for one in p['optional-dependencies'][extra] if not one.startswith('epsmesh')), sep='\n')" > requirements.txt
RUN pip install --no-cache-dir -r requirements.txt

FROM libraries AS program
COPY --chown=epsmesh LICENSE MANIFEST.in README.md pyproject.toml setup.py source/
COPY --chown=epsmesh meshes source/meshes
COPY --chown=epsmesh pipeline source/pipeline
COPY --chown=epsmesh studies source/studies
RUN pip install --no-cache-dir "./source[$EXTRAS]" && rm -rf source requirements.txt

# With JupyterLab, and a notebook to begin with.
FROM program AS lab
RUN pip install --no-cache-dir jupyterlab
COPY --chown=epsmesh notebooks/start.ipynb start.ipynb
EXPOSE 8888
CMD ["jupyter", "lab", "--ip=0.0.0.0", "--no-browser"]

FROM program AS epsmesh
CMD ["sh", "-c", "epsmesh new mine --like figure3 && epsmesh run studies/mine.toml"]
