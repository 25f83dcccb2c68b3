"""Lakes and sources in an object store, and work on a Dask cluster: real servers on this machine."""

from __future__ import annotations

import os
from contextlib import contextmanager

import pytest

import captures

pytest.importorskip("duckdb", reason="a lake is asked by DuckDB")
pytest.importorskip("fsspec", reason="a lake needs fsspec for object stores")

from lakes import batch, bus, same

from analyzer.fleet import FleetError
from analyzer.fleet.lake import Lake
from analyzer.fleet.questions import Asked, ready
from analyzer.fleet.runners import DaskCluster


@pytest.fixture
def folder(tmp_path):
    """Two sites with a line each."""
    for site in range(2):
        path = tmp_path / "src" / f"site{site}" / "bus.jsonl"
        path.parent.mkdir(parents=True)
        captures.write(path, bus("noisy" if site else "clean", seed=site, transactions=60))
    return tmp_path / "src"


@pytest.fixture
def bucket(monkeypatch):
    """An S3 endpoint on this machine with a bucket; its URL."""
    pytest.importorskip("s3fs", reason="needs s3fs")
    server = pytest.importorskip("moto.server", reason="needs moto[server] for an S3 endpoint")
    boto3 = pytest.importorskip("boto3", reason="needs boto3")
    running = server.ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    running.start()
    host, port = running.get_host_and_port()
    for name, value in {
        "AWS_ENDPOINT_URL": f"http://{host}:{port}",
        "AWS_ACCESS_KEY_ID": "testing",
        "AWS_SECRET_ACCESS_KEY": "testing",
        "AWS_DEFAULT_REGION": "us-east-1",
    }.items():
        monkeypatch.setenv(name, value)
    import s3fs

    s3fs.S3FileSystem.clear_instance_cache()
    boto3.client("s3").create_bucket(Bucket="fleet")
    yield "s3://fleet"
    s3fs.S3FileSystem.clear_instance_cache()
    running.stop()


def test_an_object_store_is_read_and_written_as_a_folder_is(folder, tmp_path, bucket):
    import boto3

    for path in sorted(folder.rglob("*.jsonl")):
        boto3.client("s3").upload_file(str(path), "fleet", f"in/{path.relative_to(folder).as_posix()}")
    batch(tmp_path / "local", folder)
    result = batch(f"{bucket}/lake", f"{bucket}/in")
    assert (result.captures, result.failed, result.damaged) == (2, 0, 0)
    assert batch(f"{bucket}/lake", f"{bucket}/in").skipped == 2
    assert batch(f"{bucket}/again", f"{bucket}/in/*/*.jsonl").captures == 2
    assert same(tmp_path / "local", f"{bucket}/lake")
    assert ready(Lake(f"{bucket}/lake"), "worst-units", Asked()).num_rows > 0
    captures.write(tmp_path / "new.jsonl", bus(seed=9, transactions=20))
    boto3.client("s3").upload_file(str(tmp_path / "new.jsonl"), "fleet", "in/site2/new.jsonl")
    assert batch(f"{bucket}/lake", f"{bucket}/in").captures == 1


@contextmanager
def cluster(workers):
    """A Dask cluster of worker processes on this machine, each with a memory limit of its own."""
    distributed = pytest.importorskip("distributed", reason="needs distributed for a Dask cluster")
    with (
        distributed.LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            memory_limit="900MB",
            dashboard_address=None,
        ) as local,
        distributed.Client(local) as client,
    ):
        yield local, client


def test_a_cluster_makes_the_same_lake_though_workers_die(folder, tmp_path):
    for line in range(6):
        captures.write(folder / "site1" / f"more{line}.jsonl", bus(seed=20 + line, transactions=60))
    batch(tmp_path / "local", folder)
    with cluster(3) as (local, client):
        runner, deaths = DaskCluster(client), list[int]()

        def runs_and_kills(tasks):
            for outcome in runner(tasks):
                if len(deaths) < 2:
                    pids = [nanny.pid for nanny in local.workers.values()]  # asking a worker that just died would fail
                    pid = next(pid for pid in pids if pid is not None and pid not in deaths)
                    os.kill(pid, 9)
                    deaths.append(pid)
                yield outcome

        result = batch(tmp_path / "lake", folder, runner=runs_and_kills)
        assert len(deaths) == 2 and result.failed == 0
        assert local.scheduler_address.startswith("tcp://")
    assert same(tmp_path / "local", tmp_path / "lake")


def test_a_scheduler_that_is_not_there_is_told():
    pytest.importorskip("distributed", reason="needs distributed for a Dask cluster")
    with pytest.raises(FleetError, match="no Dask scheduler"):
        DaskCluster("tcp://127.0.0.1:9")


def test_a_scheduler_that_goes_away_is_told(folder, tmp_path):
    for line in range(4):
        captures.write(folder / "site1" / f"more{line}.jsonl", bus(seed=20 + line, transactions=60))
    with cluster(1) as (local, client):
        runner = DaskCluster(client)

        def runs_and_leaves(tasks):
            for number, outcome in enumerate(runner(tasks)):
                if not number:
                    local.sync(local.scheduler.close)
                yield outcome

        with pytest.raises(FleetError, match="the Dask scheduler is gone"):
            batch(tmp_path / "lake", folder, runner=runs_and_leaves)
    assert len(Lake(str(tmp_path / "lake")).manifest.lines) >= 1
    assert batch(tmp_path / "lake", folder).failed == 0
    batch(tmp_path / "local", folder)
    assert same(tmp_path / "local", tmp_path / "lake")
