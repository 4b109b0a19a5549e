"""SZ3, zfp and zstd beside the codec: python codec.py FOLDER

FOLDER/jobs.json is a list of {"name", "components", "bounds", "frames": [file, ...], "points": file}, every file doubles,
little endian, tuple after tuple. Prints one JSON object for each job, bound and method: bits a value, MB/s of doubles, and
the largest error as a part of the bound. Each method codes component by component, in the best of the stored and the Morton
order (which costs it nothing here), SZ3 with the best of its three predictors.
"""
import json
import sys
import time

import numpy as np
import zfpy
import zstandard
from pysz import sz, szAlgorithm, szConfig, szErrorBoundMode

PREDICTORS = [szAlgorithm.INTERP_LORENZO, szAlgorithm.INTERP, szAlgorithm.LORENZO_REG]


def morton(points, bits=16):
    low = points.min(0)
    size = max(np.ptp(points, axis=0).max(), 1e-300)
    grid = ((points - low) / size * ((1 << bits) - 1)).astype(np.uint64)
    code = np.zeros(len(points), np.uint64)
    for bit in range(bits):
        for axis in range(3):
            code |= ((grid[:, axis] >> np.uint64(bit)) & np.uint64(1)) << np.uint64(3 * bit + axis)
    return np.argsort(code, kind="stable")


def sz3(values, bound, predictor):
    config = szConfig()
    config.errorBoundMode = szErrorBoundMode.ABS
    config.absErrorBound = float(bound)
    config.cmprAlgo = predictor
    coded = sz.compress(values, config)[0]
    decoded = sz.decompress(coded, np.float64, values.shape)[0]
    return coded.nbytes, decoded


def zfp(values, bound):
    coded = zfpy.compress_numpy(values, tolerance=float(bound))
    return len(coded), zfpy.decompress_numpy(coded)


def zstd(values, bound):
    # In steps of twice the bound, in as few bytes as hold them.
    steps = np.round((values - values.min()) / (2 * bound)).astype(np.int64)
    kind = np.uint8 if steps.max() < 256 else np.uint16 if steps.max() < 65536 else np.uint32
    coded = zstandard.ZstdCompressor(level=3).compress(steps.astype(kind).tobytes())
    return len(coded), values.min() + 2 * bound * steps


def best(methods, values, bound, orders):
    """The fewest bytes, the seconds of that, and what is decoded."""
    found = None
    for method in methods:
        for order in orders:
            ordered = np.ascontiguousarray(values[order])
            start = time.perf_counter()
            size, decoded = method(ordered, bound)
            seconds = time.perf_counter() - start
            if found is None or size < found[0]:
                back = np.empty_like(decoded)
                back[order] = decoded
                found = (size, seconds, back)
    return found


METHODS = {
    "SZ3": [lambda v, b, p=p: sz3(v, b, p) for p in PREDICTORS],
    "zfp": [zfp],
    "zstd": [zstd],
}


def main(folder):
    for job in json.load(open(f"{folder}/jobs.json")):
        points = np.fromfile(f"{folder}/{job['points']}").reshape(-1, 3)
        count = job["components"]
        frames = [np.fromfile(f"{folder}/{name}").reshape(-1, count) for name in job["frames"]]
        orders = [np.arange(len(points)), morton(points)]
        for part in job["bounds"]:
            for method, ways in METHODS.items():
                for is_temporal in (False, True):
                    if is_temporal and (len(frames) < 3 or method == "zstd"):
                        continue
                    last = np.zeros_like(frames[0])
                    size = seconds = error = values = 0
                    for index, frame in enumerate(frames):
                        if not is_temporal and index > 0:
                            break
                        bound = part * np.ptp(frame, axis=0).max()
                        decoded = np.empty_like(frame)
                        for component in range(count):
                            wanted = frame[:, component] - (last[:, component] if is_temporal else 0)
                            coded = best(ways, wanted, bound * (1 - 1e-6), orders)
                            # Of a series the frames from the third on, as for the codec.
                            if not is_temporal or index >= 2:
                                size += coded[0]
                                seconds += coded[1]
                                values += len(frame)
                            decoded[:, component] = coded[2] + (last[:, component] if is_temporal else 0)
                        error = max(error, np.abs(decoded - frame).max() / bound)
                        last = decoded
                    print(json.dumps({
                        "name": job["name"], "bound": part, "method": method, "is_temporal": is_temporal,
                        "bits": 8 * size / values, "speed": 8e-6 * values / seconds, "error": error}))


main(sys.argv[1])
