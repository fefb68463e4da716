# docker build -t uavexp . && docker run --rm -v "$PWD/outputs:/uavexp/outputs" uavexp strategy=mcr seed=0
FROM python:3.12-slim
# the first line is what Open3D loads; git names the commit in a study's run.json
RUN apt-get update && apt-get install --yes --no-install-recommends \
        libgl1 libegl1 libx11-6 libudev1 libidn2-0 libusb-1.0-0 libgomp1 \
        git make \
    && rm -rf /var/lib/apt/lists/*
WORKDIR /uavexp
COPY requirements.lock .
RUN pip install --no-cache-dir --require-hashes -r requirements.lock
COPY . .
RUN pip install --no-cache-dir --no-deps --no-build-isolation -e .
ENTRYPOINT ["python", "-m", "uavexp"]
CMD ["--help"]
