"""A Ray cluster of two nodes and an object store that speaks S3, both on this machine."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import gettempdir
from typing import Any
from unittest.mock import patch

import pytest

MISSING = "not installed: what records on Ray or to S3 is not tested here"
ThreadedMotoServer = pytest.importorskip("moto.server", reason=MISSING).ThreadedMotoServer
ray: Any = pytest.importorskip("ray", reason=MISSING)
Cluster = pytest.importorskip("ray.cluster_utils", reason=MISSING).Cluster
S3FileSystem = pytest.importorskip("s3fs", reason=MISSING).S3FileSystem


@contextmanager
def object_store() -> Iterator[str]:
    """Serve an empty bucket, to this process and to those that it starts; yield its URL."""
    server = ThreadedMotoServer("127.0.0.1", 0, verbose=False)
    server.start()
    try:
        host, port = server.get_host_and_port()
        access = {
            "AWS_ENDPOINT_URL": f"http://{host}:{port}",
            "AWS_ACCESS_KEY_ID": "nobody",
            "AWS_SECRET_ACCESS_KEY": "nothing",
            "AWS_DEFAULT_REGION": "us-east-1",
        }
        with patch.dict(os.environ, access):
            # Servers of one process share what they hold: to each a bucket of its own.
            S3FileSystem(skip_instance_cache=True).mkdir(f"bucket-{port}")
            yield f"s3://bucket-{port}"
    finally:
        server.stop()
        # The next server has another address.
        S3FileSystem.clear_instance_cache()


@contextmanager
def two_nodes(scratch: Path) -> Iterator[Any]:
    """Run a Ray cluster of two nodes with a processor each; yield it.

    Args:
        scratch: Where its workers record, which they leave behind when they are killed.
    """
    node = {"num_cpus": 1, "object_store_memory": 100_000_000}
    # A lost node is missed after two seconds instead of fifteen.
    watchful = {"health_check_initial_delay_ms": 0, "health_check_period_ms": 500}
    # Ray's own files stay where its sockets' names are short enough.
    places = {"TMPDIR": str(scratch), "RAY_TMPDIR": gettempdir()}
    with patch.dict(os.environ, {"RAY_USAGE_STATS_ENABLED": "0", **places}):
        cluster = Cluster(initialize_head=True, head_node_args={**node, "_system_config": watchful})
        try:
            cluster.add_node(**node)
            yield cluster
        finally:
            cluster.shutdown()
