"""Measure the overhead of running a batch with dask: `python benchmarks/variants/cluster.py [--count N]`.

The same variants are built by four local processes, and by four worker processes of a dask scheduler on this machine. The program prints
the additional time per variant. The robot is a pendulum without parts, so that building takes as little time as possible. The time to
connect to the scheduler is printed separately. The program exits with 1 if the overhead is more than 10 ms per variant.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

from distributed import LocalCluster

from thingc.batch import run
from thingc.batch.cluster.connection import connect
from thingc.driver.environment import Options

BOUND = 10.0
WORKERS = 4

PENDULUM = """
thingc: assembly/1
name: pendulum
parameters: {length: 300 mm}
components:
  stand: {frame: true, mass: 2 kg, inertia: {ixx: 0.01 kg*m^2, iyy: 0.01 kg*m^2, izz: 0.01 kg*m^2}}
  rod:
    frame: true
    mass: 100 g
    com: ["=length / 2", 0, 0]
    inertia: {ixx: 0.001 kg*m^2, iyy: 0.002 kg*m^2, izz: 0.002 kg*m^2}
joints:
  swing: {type: revolute, parent: stand.origin, child: rod.origin, limit: {lower: -90 deg, upper: 90 deg}}
modes: {hanging: {root: stand, base: fixed}}
"""
SWEEP = """
thingc: variants/1
assembly: pendulum.yaml
name: sweep
parameters: {length: {from: 200 mm, to: 800 mm, count: %d}}
"""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=2000)
    count = parser.parse_args().count
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "thingc.toml").write_text('thingc = "workspace/1"\n')
        (folder / "pendulum.yaml").write_text(PENDULUM)
        (folder / "sweep.yaml").write_text(SWEEP % count)
        document, options = str(folder / "sweep.yaml"), Options(store=str(folder / "store"))
        with LocalCluster(n_workers=WORKERS, threads_per_worker=1, processes=True, dashboard_address=None) as cluster:
            begun = time.perf_counter()
            with connect(cluster.scheduler_address, folder=str(folder / "jobs")) as executor:
                print(f"connected in {time.perf_counter() - begun:.2f} s")
                run(document, output=str(folder / "warm"), executor=executor, options=options, limit=2 * WORKERS)
                dask = run(document, output=str(folder / "dask"), executor=executor, options=options)
        local = run(document, output=str(folder / "local"), jobs=WORKERS, options=options)
        if dask.statuses != local.statuses or local.statuses != {"built": count}:
            raise SystemExit(f"expected {count} built variants, found {local.statuses} and {dask.statuses}")
    over = 1e3 * (dask.seconds - local.seconds) / count
    print(f"{count} variants: local {local.seconds:.2f} s, dask {dask.seconds:.2f} s: {over:.2f} ms per variant over the local engine")
    return 0 if over <= BOUND else 1


if __name__ == "__main__":
    sys.exit(main())
